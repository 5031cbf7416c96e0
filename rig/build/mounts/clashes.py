"""What overlaps, what stands in a view, and what enters a zone that must stay free."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.camera import RigCamera
from rig.build.mounts.plan import Clash
from rig.build.mounts.shapes import ConvexShape, Crowd, gap_mm
from rig.build.mounts.structure import Solid
from rig.build.mounts.surroundings import Surroundings

ROUNDING_MM = 0.05
"""A gap this much short of what was asked is no clash: round parts are modelled too large."""

CAMERA_KINDS = ("camera", "lens")
FIXED_KINDS = ("member", "plate", "bracket", "joint")
"""Of these nothing moves: a bracket or a pivot may touch what is bolted beside it."""

Joined = frozenset[frozenset[str]]
"""Pairs of owners that are bolted together and may touch."""


def pairs(*owners: tuple[str, str]) -> Joined:
    """The pairs as :data:`Joined`."""
    return frozenset(frozenset(pair) for pair in owners)


def required_mm(one: Solid, other: Solid, joined: Joined, around: Surroundings) -> float | None:
    """The gap that two solids must keep; None when they belong together."""
    if one.owner == other.owner or frozenset((one.owner, other.owner)) in joined:
        return None
    if one.kind in CAMERA_KINDS and other.kind in CAMERA_KINDS:
        return around.limits.body_clearance_mm or 0.0
    kinds = (one.kind, other.kind)
    if "joint" in kinds and all(kind in FIXED_KINDS for kind in kinds):
        return 0.0
    return around.clearance_mm


def find_clashes(
    solids: tuple[Solid, ...],
    joined: Joined,
    cameras: tuple[RigCamera, ...],
    around: Surroundings,
) -> tuple[Clash, ...]:
    """Every clash of a structure; of many between the same two things the worst."""
    shapes = [ConvexShape(solid.corners_mm) for solid in solids]
    crowd = Crowd(shapes)
    found = list(_solid_clashes(solids, shapes, crowd, joined, around))
    found += _view_clashes(solids, shapes, crowd, cameras, around)
    found += _zone_clashes(solids, shapes, crowd, around)
    worst: dict[tuple[str, str, str], Clash] = {}
    for clash in found:
        key = (clash.kind, clash.one, clash.other)
        if key not in worst or clash.clearance_mm < worst[key].clearance_mm:
            worst[key] = clash
    return tuple(worst.values())


def _solid_clashes(
    solids: tuple[Solid, ...],
    shapes: list[ConvexShape],
    crowd: Crowd,
    joined: Joined,
    around: Surroundings,
) -> Iterator[Clash]:
    widest = max(around.clearance_mm, around.limits.body_clearance_mm or 0.0)
    for i, solid in enumerate(solids):
        for k in crowd.near(shapes[i], widest):
            if k <= i:
                continue
            required = required_mm(solid, solids[k], joined, around)
            if required is None:
                continue
            gap = gap_mm(shapes[i], shapes[k], required)
            if gap < required - ROUNDING_MM:
                one, other = sorted((solid.owner, solids[k].owner))
                yield Clash("solid", one, other, gap, required)


def _view_clashes(
    solids: tuple[Solid, ...],
    shapes: list[ConvexShape],
    crowd: Crowd,
    cameras: tuple[RigCamera, ...],
    around: Surroundings,
) -> Iterator[Clash]:
    required = around.view_clearance_mm
    for camera in cameras:
        view = around.view(camera)
        if view is None:
            continue
        for k in crowd.near(view, required):
            solid = solids[k]
            # The view begins inside its own lens.
            if solid.owner == camera.name and solid.kind in CAMERA_KINDS:
                continue
            gap = gap_mm(view, shapes[k], required)
            if gap < required - ROUNDING_MM:
                yield Clash("view", camera.name, solid.owner, gap, required)


def _zone_clashes(
    solids: tuple[Solid, ...], shapes: list[ConvexShape], crowd: Crowd, around: Surroundings
) -> Iterator[Clash]:
    for zone in around.zones:
        for k in crowd.near(zone.shape, 0.0):
            gap = gap_mm(zone.shape, shapes[k], 0.0)
            if gap < -ROUNDING_MM:
                yield Clash("solid", zone.name, solids[k].owner, gap, 0.0)


class Site:
    """A structure in the making: tells how many clashes a further part of it would bring."""

    def __init__(
        self,
        solids: tuple[Solid, ...],
        cameras: tuple[RigCamera, ...],
        around: Surroundings,
        extra_mm: float,
    ) -> None:
        self._around, self._extra = around, extra_mm
        self._solids = list(solids)
        self._crowd = Crowd([ConvexShape(solid.corners_mm) for solid in solids])
        views = [view for view in map(around.view, cameras) if view is not None]
        self._views = Crowd(views)
        self._zones = Crowd([zone.shape for zone in around.zones])

    def add(self, solids: tuple[Solid, ...]) -> None:
        """Put a part in its place."""
        self._solids += solids
        self._crowd.add([ConvexShape(solid.corners_mm) for solid in solids])

    def between(self, solids: tuple[Solid, ...], others: tuple[Solid, ...], joined: Joined) -> int:
        """How many clashes two parts that are not yet in their places would have."""
        crowd, count = Crowd([ConvexShape(solid.corners_mm) for solid in others]), 0
        for solid in solids:
            shape = ConvexShape(solid.corners_mm)
            for k in crowd.near(shape, self._around.clearance_mm):
                need = required_mm(solid, others[k], joined, self._around)
                if need is not None:
                    count += gap_mm(shape, crowd.shapes[k], need) < need - ROUNDING_MM
        return count

    def clashes(self, solids: tuple[Solid, ...], joined: Joined) -> int:
        """How many clashes these solids would bring, with ``extra_mm`` of room to move."""
        return sum(self._of(solid, joined) for solid in solids)

    def _of(self, solid: Solid, joined: Joined) -> int:
        shape, count = ConvexShape(solid.corners_mm), 0
        for k in self._crowd.near(shape, self._around.clearance_mm + self._extra):
            required = required_mm(solid, self._solids[k], joined, self._around)
            if required is not None:
                need = required + self._extra
                count += gap_mm(shape, self._crowd.shapes[k], need) < need
        for crowd, need in (
            (self._views, self._around.view_clearance_mm + self._extra),
            (self._zones, self._extra),
        ):
            near = crowd.near(shape, need)
            count += sum(gap_mm(crowd.shapes[k], shape, need) < need for k in near)
        return count
