"""Mount plans."""

from __future__ import annotations

from collections.abc import Iterable

from common.errors import InputError
from common.progress import Progress, within
from geometry.preparation import prepare_subject
from geometry.reading import read_scan
from rig.build.folder.planfiles import PlanOptions
from rig.build.folder.planfolder import write_plan
from rig.build.mounts.making import make_plan
from rig.build.mounts.plan import Clash, Figures, MountPlan, Price, Sag, Stance, Tolerance
from rig.build.mounts.settings import CameraMount
from rig.build.parts import Prices, Stock, must_be_known
from rig.catalogue import load_catalogue
from rig.design.designfile import read_design
from service.jobs.engine import Running, Task
from service.kinds.plan import (
    PlanCamera,
    PlanClash,
    PlanNetwork,
    PlanPrice,
    PlanRequest,
    PlanResult,
    PlanSag,
    PlanSetting,
    PlanStance,
    PlanTolerance,
)

_PLANNING, _WRITING = 0.05, 0.75


def plan(task: Task[PlanRequest, PlanResult], running: Running) -> PlanResult:
    """Plan a mount for the inputs ``design`` and ``scan``; writes all that a builder needs."""
    running.report(Progress("reading the design and the scan", 0.0))
    request, catalogue = task.request, load_catalogue()
    system = request.mount.checked(catalogue)
    read = read_design(task.inputs["design"])
    if read.file.rig is None:
        raise InputError(
            "design-without-rig",
            f"{task.inputs['design'].name} does not say its limits",
            "give a design.json that `rigwright design` wrote",
        )
    prices = Prices(system.currency, system.prices)
    must_be_known(prices, read.cameras, catalogue)
    rig = read.file.rig.to_spec()
    scan = read_scan(task.inputs["scan"], rig.scan_options)
    subject = prepare_subject(scan, rig.subject_options).subject
    made = make_plan(
        read.cameras,
        subject,
        rig.limits,
        system,
        name=request.name or read.name,
        seed=request.seed,
        progress=within(running.report, _PLANNING, _WRITING),
        cancel=running.cancel,
    )
    options = PlanOptions(
        catalogue=catalogue,
        prices=prices,
        occluder=subject.occluder,
        paper=request.paper,
        step=request.step,
        stock=Stock(request.mount.bar_mm, request.mount.kerf_mm),
    )
    writing = within(running.report, _WRITING, 1.0)
    write_plan(made, task.folder, options, progress=writing, cancel=running.cancel)
    return in_short(made)


def in_short(made: MountPlan) -> PlanResult:
    """A plan in short."""
    structure = made.structure
    return PlanResult(
        name=made.name,
        system=made.system,
        buildable=made.buildable,
        clashes=[_clash(clash) for clash in made.clashes],
        price=_price(made.price),
        yield_share=made.yield_share,
        yield_trials=made.yield_trials,
        tightest=[_tolerance(row) for row in _tightest(made.tolerances)],
        members=len(structure.members),
        member_length_mm=float(sum(member.length_mm for member in structure.members)),
        plates=len(structure.plates),
        wedges=len(structure.wedges),
        parts=len(structure.parts),
        cameras=[_camera(mount) for mount in made.mounts],
        steps=list(made.steps),
        notes=list(made.notes),
        sags=[_sag(sag) for sag in made.sags],
        stances=[_stance(stance) for stance in made.stances],
    )


def _sag(sag: Sag) -> PlanSag:
    return PlanSag(
        camera=sag.camera,
        sinks_mm=float(sag.shift),
        leans_deg=float(sag.lean_deg),
        touched_mm=float(sag.touched_mm),
        touched_deg=float(sag.touched_deg),
        too_far=sag.words if sag.worst.share > 1.0 else "",
    )


def _stance(stance: Stance) -> PlanStance:
    return PlanStance(
        on=list(stance.on),
        mass_kg=float(stance.mass_kg),
        height_mm=float(stance.height_mm),
        push_n=float(stance.push_n),
        tips_n=float(stance.tips_n),
        too_little="" if stance.stands else stance.words,
    )


def _camera(mount: CameraMount) -> PlanCamera:
    settings = [
        PlanSetting(name=s.name, value=float(s.value), unit=s.unit, step=float(s.step))
        for s in mount.settings
    ]
    return PlanCamera(name=mount.name, settings=settings)


def _price(price: Price) -> PlanPrice:
    return PlanPrice(
        designed=_network(price.designed),
        rounded=_network(price.rounded),
        built=_network(price.built),
        sigma_loss=float(price.sigma_loss),
        coverage_loss=float(price.coverage_loss),
    )


def _network(figures: Figures) -> PlanNetwork:
    return PlanNetwork(
        sigma_median_mm=float(figures.sigma_median_mm),
        sigma_p95_mm=float(figures.sigma_p95_mm),
        coverage_2_views=float(figures.coverage_2_views),
        coverage_3_views=float(figures.coverage_3_views),
        feasible=bool(figures.feasible),
        broken=list(figures.broken),
    )


def _clash(clash: Clash) -> PlanClash:
    return PlanClash(
        kind=clash.kind,
        one=clash.one,
        other=clash.other,
        clearance_mm=float(clash.clearance_mm),
        required_mm=float(clash.required_mm),
    )


def _tolerance(row: Tolerance) -> PlanTolerance:
    return PlanTolerance(
        camera=row.camera,
        setting=row.setting,
        unit=row.unit,
        plus=float(row.plus),
        minus=float(row.minus),
        limit=row.limit,
    )


def _tightest(tolerances: Iterable[Tolerance]) -> list[Tolerance]:
    """Of each kind of setting the one that may be least off."""
    rows: dict[tuple[str, str], Tolerance] = {}
    for row in tolerances:
        key = row.setting, row.unit
        if key not in rows or min(row.plus, row.minus) < min(rows[key].plus, rows[key].minus):
            rows[key] = row
    return list(rows.values())
