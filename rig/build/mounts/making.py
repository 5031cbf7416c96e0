"""From the cameras of a design to a plan that can be built."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from common.errors import CancelledError, InputError
from common.progress import CancelToken, NeverCancelled, Progress, ProgressCallback, ignore_progress
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.build.mounts.clashes import find_clashes, pairs
from rig.build.mounts.plan import Figures, MountPlan, Price
from rig.build.mounts.relaxing import VIEWS, relaxed
from rig.build.mounts.rounding import Rounder, nearest, needs_rounding
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.solids import camera_solids
from rig.build.mounts.steps import assembly_steps
from rig.build.mounts.surroundings import SEAT_HEIGHT_MM, Surroundings, Zone, head_entry
from rig.build.mounts.systems.base import Holding, MountSystem
from rig.build.mounts.tolerancing import Tolerancer, trials_for, yield_share
from rig.build.statics.steadying import settled_stances, steadied
from rig.build.statics.stiffening import Stiffened, settled_sags, stiffened
from rig.build.statics.weights import Masses
from rig.catalogue import load_catalogue
from rig.catalogue.items import Profile
from solver.limits import Limits
from solver.quality import evaluate, keeps_limits
from solver.result import Quality


@dataclass(frozen=True, eq=False)
class SystemSpec:
    """A mount system with what it must keep clear of.

    ``zones`` stay free, and the subject's head entry too unless ``entry`` is off.
    ``floor_z_mm`` None: a seated person's nose height under the datum. ``spare``: share of the
    effect of settings half a step off that limits are kept clear of. ``prices`` by catalogue id.
    ``larger``: the same mount with stays of larger profiles, for cameras that would lean; none
    where the profile was asked for. ``stiffen`` off: it is built as it is and only judged.
    ``masses``: what the cameras and parts weigh.
    """

    name: str
    system: MountSystem
    zones: tuple[Zone, ...] = ()
    entry: bool = True
    floor_z_mm: float | None = None
    clearance_mm: float = 2.0
    spare: float = 1.0
    prices: dict[str, float] = field(default_factory=dict)
    currency: str = "EUR"
    masses: Masses = field(default_factory=lambda: Masses(load_catalogue()))
    larger: tuple[tuple[Profile, MountSystem], ...] = ()
    stiffen: bool = True

    def surroundings(
        self, subject: Subject, limits: Limits, standing: tuple[RigCamera, ...]
    ) -> Surroundings:
        """Where a rig for this subject would stand; ``standing`` cameras are there already."""
        datum = subject.foremost_mm
        floor = self.floor_z_mm
        if floor is None:
            floor = float(np.round(datum[2])) - SEAT_HEIGHT_MM
        zones = (head_entry(subject, floor), *self.zones) if self.entry else self.zones
        return Surroundings(subject, limits, zones, floor, self.clearance_mm, standing)


def figures(quality: Quality) -> Figures:
    """The figures of an evaluation that a plan states."""
    share = {c.views: c.share for c in quality.coverage}
    return Figures(
        quality.sigma_median_mm,
        quality.sigma_p95_mm,
        share.get(2, 0.0),
        share.get(3, 0.0),
        quality.feasible,
        tuple(row.name for row in quality.violated),
    )


class _Job:
    """One plan in the making."""

    def __init__(
        self,
        cameras: tuple[RigCamera, ...],
        subject: Subject,
        limits: Limits,
        progress: ProgressCallback,
        cancel: CancelToken,
    ) -> None:
        self.cameras, self.subject, self.limits = cameras, subject, limits
        self._progress, self.cancel = progress, cancel
        self._fraction = 0.0

    def tell(self, stage: str, fraction: float) -> None:
        if self.cancel.is_set():
            raise CancelledError
        self._fraction = max(self._fraction, fraction)
        self._progress(Progress(stage, self._fraction))

    def network(self, mounts: tuple[CameraMount, ...]) -> tuple[RigCamera, ...]:
        """All cameras, those on mounts as their settings put them."""
        placed = {mount.name: mount.camera for mount in mounts}
        return tuple(placed.get(c.name, c) for c in self.cameras)

    def evaluate(self, mounts: tuple[CameraMount, ...]) -> Quality:
        return evaluate(self.subject, self.network(mounts), self.limits)

    def relaxed(self, spec: SystemSpec) -> tuple[tuple[RigCamera, ...], float]:
        """The cameras with room to set them, and how much of it."""
        if max(spec.system.steps) <= 0.0:
            return self.cameras, 0.0
        return relaxed(
            self.cameras, self.subject, self.limits, steps=spec.system.steps, spare=spec.spare,
            tell=lambda share: self.tell("make room", 0.5 * share), cancel=self.cancel,
        )  # fmt: skip

    def stiff(
        self, spec: SystemSpec, cameras: tuple[RigCamera, ...], around: Surroundings
    ) -> Stiffened:
        """The system with what it needs neither to lean nor to tip over, as first arranged."""
        if not spec.stiffen:
            return Stiffened(spec.system, spec.system.hold(cameras, around))
        stiff = stiffened(spec.system, spec.larger, cameras, around, spec.masses)
        return steadied(stiff, cameras, around, spec.masses)

    def rounded(self, holding: Holding, spare: float) -> tuple[CameraMount, ...]:
        """Settings that exist; those of before where all do."""
        if not needs_rounding(holding.mounts):
            return holding.mounts
        cameras, mounts = self.cameras, holding.mounts
        designed = evaluate(self.subject, cameras, self.limits).feasible
        for _ in range(VIEWS):
            rounder = Rounder(
                self.subject, self.limits, cameras, mounts, spare=spare,
                tell=lambda share: self.tell("round", 0.2 + 0.4 * share), cancel=self.cancel,
            )  # fmt: skip
            mounts = rounder.run()
            cameras = self.network(mounts)
            if not designed or evaluate(self.subject, cameras, self.limits).feasible:
                break
        return mounts

    def price(self, naive: tuple[CameraMount, ...], built: tuple[CameraMount, ...]) -> Price:
        designed = figures(evaluate(self.subject, self.cameras, self.limits))
        return Price(designed, figures(self.evaluate(naive)), figures(self.evaluate(built)))


def _must_stand(cameras: tuple[RigCamera, ...], around: Surroundings) -> None:
    """Raises :class:`InputError` where the floor is over a camera."""
    lowest = min(cameras, key=lambda c: float(c.pose.position_rig_mm[2]))
    height = float(lowest.pose.position_rig_mm[2])
    if around.floor_z_mm >= height:
        raise InputError(
            "mount-floor",
            f"the floor at {around.floor_z_mm:g} mm is over {lowest.name} at {height:.0f} mm",
            f"give a floor_z_mm well below {height:.0f}, or leave it out",
        )


HOPELESS_MM = 30.0
"""Making room and rounding move a camera by less than this: what overlaps by more stays so."""


def _must_fit(free: tuple[RigCamera, ...], around: Surroundings) -> None:
    """Raises :class:`InputError` where the cameras alone, as designed, leave no rig possible.

    Asked before any mount is arranged: the search for places would end with the same verdict
    after minutes.
    """
    everyone = (*free, *around.standing)
    solids = tuple(s for camera in everyone for s in camera_solids(camera))
    names = {camera.name for camera in free}
    deep = [
        clash
        for clash in find_clashes(solids, pairs(), everyone, around)
        if clash.clearance_mm < clash.required_mm - HOPELESS_MM and {clash.one, clash.other} & names
    ]
    if not deep:
        return
    worst = min(deep, key=lambda clash: clash.clearance_mm - clash.required_mm)
    zones = {zone.name for zone in around.zones}
    by_mm = worst.required_mm - worst.clearance_mm
    what = "stands in the view of" if worst.kind == "view" else "reaches into"
    remedy = "give the true sizes of the bodies, or design with more clearance between them"
    if worst.one in zones:
        remedy = f"keep the zone {worst.one} clear of the cameras, or design them outside it"
    raise InputError(
        "mount-hopeless",
        f"no mount can hold these cameras: {worst.other} {what} {worst.one} by {by_mm:.0f} mm "
        f"where the design puts it{f', and {len(deep) - 1} more' if len(deep) > 1 else ''}",
        remedy,
    )


def make_plan(
    cameras: tuple[RigCamera, ...],
    subject: Subject,
    limits: Limits,
    spec: SystemSpec,
    *,
    name: str = "rig",
    seed: int = 0,
    trials: int | None = None,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> MountPlan:
    """The plan of a mount for ``cameras``, whose poses are those of a design.

    Cameras that are ``fixed`` stand already: they are kept clear of and count in every figure,
    but nothing is built for them, unless all are: then the mount is to hold them where they are.
    Raises a one-line :class:`InputError` for a mount that cannot
    be built, with the nearest possibility, and :class:`CancelledError` soon after ``cancel``.
    """
    if all(camera.fixed for camera in cameras):
        cameras = tuple(replace(camera, fixed=False) for camera in cameras)
    job = _Job(cameras, subject, limits, progress, cancel or NeverCancelled())
    free = tuple(camera for camera in cameras if not camera.fixed)
    if not free:
        raise InputError("no-cameras", "no camera needs a mount", "plan a design that places some")
    standing = tuple(camera for camera in cameras if camera.fixed)
    around = spec.surroundings(subject, limits, standing)
    _must_stand(free, around)
    _must_fit(free, around)
    if (head := spec.system.head) is not None:
        for camera in free:
            head.must_carry(camera, spec.masses.of_camera(camera))
    stiff = job.stiff(spec, free, around)
    naive = tuple(nearest(mount) for mount in stiff.first.mounts)
    roomy, spare = job.relaxed(spec)
    job.tell("arrange", 0.2)
    holding = stiff.system.hold(tuple(c for c in roomy if not c.fixed), around)
    settled = job.rounded(holding, spare)
    job.tell("build", 0.6)
    wanted = {camera.name: camera.pose for camera in free}
    settled = tuple(replace(mount, wanted=wanted[mount.name]) for mount in settled)
    built = holding.with_mounts(settled).build()
    solids = built.structure.solids + tuple(s for c in standing for s in camera_solids(c))
    clashes = find_clashes(solids, built.joined, job.network(built.mounts), around)
    price = job.price(naive, built.mounts)
    tolerancer = Tolerancer(
        subject, limits, job.network(built.mounts), built.mounts,
        tell=lambda share: job.tell("tolerances", 0.65 + 0.25 * share), cancel=job.cancel,
    )  # fmt: skip
    tolerances = tolerancer.each()
    found, unknown = settled_sags(built.structure, built.mounts, tolerances, spec.masses)
    stand, tips = settled_stances(built.structure, built.mounts, around.datum_mm, spec.masses)
    job.tell("trials", 0.9)
    count = trials_for(len(cameras)) if trials is None else trials
    share = yield_share(
        lambda tried: keeps_limits(subject, tried, limits), job.network(built.mounts),
        built.mounts, seed=seed, trials=count, cancel=job.cancel,
    )  # fmt: skip
    job.tell("done", 1.0)
    return MountPlan(
        name=name,
        system=spec.system.kind,
        datum_rig_mm=around.datum_mm,
        structure=replace(built.structure, solids=solids),
        mounts=built.mounts,
        price=price,
        tolerances=tolerances,
        clashes=clashes,
        yield_share=share,
        yield_trials=count,
        steps=assembly_steps(built.structure, built.mounts, spec.masses.catalogue, found),
        notes=(*built.notes, *stiff.notes, *unknown, *tips),
        sags=found,
        stances=stand,
    )
