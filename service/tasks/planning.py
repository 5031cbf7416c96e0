"""Mount plans, asked for over HTTP or on the command line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.files.plain import plain
from common.progress import CancelToken, Progress, ProgressCallback
from geometry.preparation import prepare_subject
from geometry.reading import read_scan
from rig.build.folder.planfiles import PlanOptions
from rig.build.folder.planfolder import write_plan
from rig.build.mounts.making import make_plan
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.systemfile import read_system, system_from_mapping
from rig.build.parts import Prices, must_be_known
from rig.catalogue import load_catalogue
from rig.design.designfile import read_design

JSON = dict[str, Any]
Request = Mapping[str, Any]
Inputs = Mapping[str, Path]
_PLANNING, _WRITING = 0.05, 0.75


def plan(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Plan a mount for a design and write all that a builder needs into ``folder``.

    Inputs ``design`` and ``scan``, and ``mount`` unless the request has it as JSON.
    """
    report(Progress("reading the design and the scan", 0.0))
    catalogue = load_catalogue()
    if "mount" in inputs:
        system = read_system(inputs["mount"], catalogue)
    else:
        system = system_from_mapping(request["mount"], "mount", catalogue)
    read = read_design(inputs["design"])
    if read.file.rig is None:
        raise InputError(
            "design-without-rig",
            f"{inputs['design'].name} does not say its limits",
            "give a design.json that `rigwright design` wrote",
        )
    prices = Prices(system.currency, system.prices)
    must_be_known(prices, read.cameras, catalogue)
    rig = read.file.rig.to_spec()
    scan = read_scan(inputs["scan"], rig.scan_options)
    subject = prepare_subject(scan, rig.subject_options).subject
    made = make_plan(
        read.cameras,
        subject,
        rig.limits,
        system,
        name=request["name"] or read.name,
        seed=request["seed"],
        progress=_between(report, _PLANNING, _WRITING),
        cancel=cancel,
    )
    options = PlanOptions(
        catalogue=catalogue,
        prices=prices,
        occluder=subject.occluder,
        paper=request["paper"],
        step=request["step"],
    )
    write_plan(made, folder, options, progress=_between(report, _WRITING, 1.0), cancel=cancel)
    return plan_figures(made)


def _between(report: ProgressCallback, first: float, last: float) -> ProgressCallback:
    def within(inner: Progress, /) -> None:
        report(Progress(inner.stage, first + (last - first) * inner.fraction))

    return within


def plan_figures(made: MountPlan) -> JSON:
    """A plan in short."""
    structure = made.structure
    figures: JSON = plain(
        {
            "name": made.name,
            "system": made.system,
            "buildable": not made.clashes,
            "clashes": [vars(clash) for clash in made.clashes],
            "price": {
                "designed": made.price.designed,
                "rounded": made.price.rounded,
                "built": made.price.built,
                "sigma_loss": made.price.sigma_loss,
                "coverage_loss": made.price.coverage_loss,
            },
            "yield_share": made.yield_share,
            "yield_trials": made.yield_trials,
            "tightest": [vars(row) for row in _tightest(made)],
            "members": len(structure.members),
            "member_length_mm": sum(member.length_mm for member in structure.members),
            "plates": len(structure.plates),
            "wedges": len(structure.wedges),
            "parts": len(structure.parts),
            "cameras": [
                {
                    "name": mount.name,
                    "settings": [
                        {"name": s.name, "value": s.value, "unit": s.unit, "step": s.step}
                        for s in mount.settings
                    ],
                }
                for mount in made.mounts
            ],
            "steps": made.steps,
            "notes": made.notes,
        }
    )
    return figures


def _tightest(made: MountPlan) -> list[Any]:
    """Of each kind of setting the one that may be least off."""
    rows: dict[tuple[str, str], Any] = {}
    for row in made.tolerances:
        key = row.setting, row.unit
        if key not in rows or min(row.plus, row.minus) < min(rows[key].plus, rows[key].minus):
            rows[key] = row
    return list(rows.values())
