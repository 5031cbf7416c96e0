"""Coverage of a network in the solver's inner loop: who is seen, what is promised, what is lost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera
from geometry.surface import SurfacePoints
from solver.constraints.base import bound
from solver.constraints.candidates import Candidates
from solver.constraints.places import PlaceCones
from solver.coverage.assignment import Margins, Promises, promise
from solver.coverage.visibility import Sight, cosines, horizons, sight
from solver.motion import HeadPosition
from solver.problem import Scene
from solver.variables import NetworkState

_HORIZON_MARGIN = float(np.sin(np.radians(0.3)))
"""A camera stays this far above a horizon: ray casting against facets is no more exact."""


FIRST_MARGINS = Margins()
_ABOUT_TO_BE_SEEN_DEG = 15.0
"""How far beyond the limit of incidence points are framed: about what a camera swings by in a
round. With less, round after round finds new points just outside the frame."""


@dataclass(frozen=True, eq=False)
class Views:
    """What is seen at one state: ``seen`` (n, p) of the design points, and the promises made.

    ``framed`` (n, q) are the check points kept in frame and in focus: those that face the
    camera, or would after a small move. Without the latter, every round would find new points
    just outside the frame.
    """

    seen: Bools
    framed: Bools
    promises: Promises
    margin_deg: float = 0.0

    def among(self, scene: Scene, chosen: Ints) -> Views:
        """The same views of a scene of whose design points these were the ``chosen`` ones."""
        seen = np.zeros((scene.count, len(scene.subject.design_points)), dtype=np.bool_)
        seen[:, chosen] = self.seen
        promises = Promises(self.promises.camera, chosen[self.promises.point], self.promises.kept)
        return Views(seen, self.framed, promises, self.margin_deg)


def centres_mm(scene: Scene, state: NetworkState) -> Floats:
    """Projection centres (n, 3) in the rig frame."""
    return np.asarray(state.centre * scene.length_mm + scene.origin_mm)


def in_frame(camera: RigCamera, points_mm: Floats, margin_px: float = 0.0) -> Bools:
    """Which points (n, 3) fall inside a camera's image, (n,)."""
    pixels, depth = camera.camera.project(camera.pose, points_mm)
    w, h = camera.camera.image_size_px
    low, high = margin_px - 0.5, -0.5 - margin_px
    inside = (pixels > low).all(axis=1) & (pixels[:, 0] < w + high) & (pixels[:, 1] < h + high)
    return np.asarray(inside & (depth > 0.0))


def views(
    scene: Scene,
    state: NetworkState,
    earlier: Views | None = None,
    margins: Margins = FIRST_MARGINS,
) -> Views:
    """Cast all rays and decide which views to promise.

    Free cameras are given frame and focus as limits, so facing and a free line of sight are
    enough; fixed cameras only see what is in their frame. What was framed and promised in an
    ``earlier`` round is held on to, so that rounds settle. ``margins`` say what
    is promised beyond what the tiers ask.
    """
    source = scene.subject.design_points
    limit = scene.limits.incidence.ray_max_deg
    found = sight(
        source, scene.subject.occluder, centres_mm(scene, state), limit, scene.visibility_positions
    )
    seen = found.seen
    for i, camera in enumerate(scene.cameras):
        if camera.fixed:
            seen[i] &= in_frame(camera, source.points_mm)
    fixed = np.array([c.fixed for c in scene.cameras])
    framed = _facing(scene, state, min(limit + _ABOUT_TO_BE_SEEN_DEG, 90.0))
    before = None
    if earlier is not None:
        framed, before = framed | earlier.framed, earlier.promises
    deficits = _deficits(scene, state, found, seen, margins.angle_deg)
    promises = promise(scene.limits.coverage.tiers, deficits, fixed, margins.share, before)
    return Views(seen, framed, promises, margins.angle_deg)


@dataclass(frozen=True, eq=False)
class Judged:
    """Coverage as it will be judged: on the check points, at the worst head position.

    ``shortfall`` is the share by which the worst tier is missed, 0 when all are met;
    ``missed`` are indices of check points that would mend it, the easiest to win first.
    """

    shortfall: float
    missed: Ints


def judge(scene: Scene, state: NetworkState) -> Judged:
    """Count the views of all check points."""
    tiers, source = scene.limits.coverage.tiers, scene.subject.check_points
    worst, missed = 0.0, [np.zeros(0, dtype=np.int64)]
    limit = scene.limits.incidence.ray_max_deg
    for position in scene.visibility_positions if tiers else ():
        found = sight(source, scene.subject.occluder, centres_mm(scene, state), limit, (position,))
        seen = found.seen
        for i, camera in enumerate(scene.cameras):
            if camera.fixed:
                seen[i] &= in_frame(camera, position.points(source.points_mm))
        count = seen.sum(axis=0)
        for tier in tiers:
            lack = tier.share - float((count >= tier.views).mean())
            if lack > 0.0:
                worst = max(worst, lack)
                missed.append(_easiest(found.cosine, count, tier.views, lack))
    return Judged(worst, np.unique(np.concatenate(missed)))


def _easiest(cosine: Floats, count: Ints, views_wanted: int, lack: float) -> Ints:
    """Check points with too few views that come nearest to having them, enough to mend the lack."""
    poor = np.flatnonzero(count < views_wanted)
    nth_best = np.sort(cosine[:, poor], axis=0)[-min(views_wanted, len(cosine))]
    enough = int(np.ceil(1.5 * lack * len(count))) + 2
    return np.asarray(poor[np.argsort(-nth_best, kind="stable")[:enough]])


def with_points(scene: Scene, missed: Ints) -> Scene:
    """The scene with some check points among its design points, so that they are promised views."""
    if len(missed) == 0:
        return scene
    old, extra = scene.subject.design_points, scene.subject.check_points.subset(missed)
    known = {p.tobytes() for p in old.points_mm}
    fresh = [k for k, p in enumerate(extra.points_mm) if p.tobytes() not in known]
    points = SurfacePoints(
        np.concatenate([old.points_mm, extra.points_mm[fresh]]),
        np.concatenate([old.normals, extra.normals[fresh]]),
    )
    return replace(
        scene,
        subject=replace(scene.subject, design_points=points),
        origin=scene.origin_mm,
        object_points=len(old) if scene.object_points is None else scene.object_points,
    )


def _facing(scene: Scene, state: NetworkState, limit_deg: float) -> Bools:
    """Check points (n, q) whose normals are within the limit of the ray, in any head position."""
    source = scene.subject.check_points
    least = np.cos(np.radians(limit_deg))
    out = np.zeros((scene.count, len(source)), dtype=np.bool_)
    for i, centre in enumerate(centres_mm(scene, state)):
        for position in scene.visibility_positions:
            out[i] |= cosines(source, position.eye_seen_by_head(centre)) > least
    return out


def _deficits(
    scene: Scene, state: NetworkState, found: Sight, seen: Bools, margin_deg: float
) -> Floats:
    """How far each camera is from seeing each point, (n, p) degrees; see :func:`promise`."""
    limit = scene.limits.incidence.ray_max_deg - margin_deg
    incidence = np.degrees(np.arccos(np.clip(found.cosine, -1.0, 1.0)))
    out = np.where(seen, incidence - limit - 1e-9, np.inf)
    most = max((t.views for t in scene.limits.coverage.tiers), default=0)
    poor = (out <= 0.0).sum(axis=0) < min(most, scene.count)
    camera, point = np.nonzero(~seen & poor)
    if len(camera) == 0:
        return out
    source = scene.subject.design_points
    eyes = centres_mm(scene, state)[camera]
    hidden = horizons(source, scene.subject.occluder, point, eyes, source.normals[point])
    facing = np.maximum(0.0, incidence[camera, point] - limit)
    out[camera, point] = np.maximum(hidden.swing_deg, facing) + 1e-6
    return out


@dataclass(frozen=True, eq=False)
class Cuts:
    """Horizons that cameras must stay above to see points they were promised.

    ``camera`` and ``point`` (m,) name the ray; ``place`` and ``normal`` (m, 3) the plane, in
    the solver's units.
    """

    camera: Ints
    point: Ints
    place: Floats
    normal: Floats

    @classmethod
    def none(cls) -> Cuts:
        """No cuts."""
        empty = np.zeros(0, dtype=np.int64)
        return cls(empty, empty, np.zeros((0, 3)), np.zeros((0, 3)))

    def joined(self, other: Cuts) -> Cuts:
        """These cuts and the others."""
        return Cuts(
            np.concatenate([self.camera, other.camera]),
            np.concatenate([self.point, other.point]),
            np.concatenate([self.place, other.place]),
            np.concatenate([self.normal, other.normal]),
        )

    def of(self, promises: Promises) -> Cuts:
        """The cuts of rays that are still promised."""
        stride = 1 + int(max(self.point.max(initial=0), promises.point.max(initial=0)))
        keep = np.isin(self.camera * stride + self.point, promises.camera * stride + promises.point)
        return Cuts(self.camera[keep], self.point[keep], self.place[keep], self.normal[keep])

    def rows(self, scene: Scene) -> list[Candidates]:
        """The cuts as rows, all of them worked on."""
        if len(self.camera) == 0:
            return []
        block = PlaceCones(
            "coverage",
            "mm",
            scene.length_mm,
            bound(0.0, self.camera),
            bound(np.inf, self.camera),
            self.camera,
            self.place,
            self.normal,
            bound(_HORIZON_MARGIN, self.camera),
        )
        return [Candidates.all_of(block)]


def cuts_for_hidden(scene: Scene, state: NetworkState, promises: Promises, open_mm: Floats) -> Cuts:
    """Horizons for the promised rays that something hides at ``state``, in every head position.

    ``open_mm`` (m, 3) are directions of the rig frame in which each promised point is visible.
    """
    source, occluder = scene.subject.design_points, scene.subject.occluder
    points, normals = source.points_mm[promises.point], source.normals[promises.point]
    eyes = centres_mm(scene, state)[promises.camera]
    cuts = Cuts.none()
    for position in scene.visibility_positions:
        local = _in_head(position, eyes)
        rows = np.flatnonzero(occluder.hidden(points, normals, local))
        if len(rows) == 0:
            continue
        found = horizons(
            source, occluder, promises.point[rows], local[rows], open_mm[rows] @ position.turn
        )
        place = scene.scaled(position.points(found.point_mm))
        normal = position.directions(found.normal)
        cuts = cuts.joined(Cuts(promises.camera[rows], promises.point[rows], place, normal))
    return cuts


def _in_head(position: HeadPosition, eyes_mm: Floats) -> Floats:
    """Eyes (m, 3) as seen by somebody fixed to the moved head."""
    return np.asarray(
        (eyes_mm - position.pivot_mm - position.shift_mm) @ position.turn + position.pivot_mm
    )


def opening_directions(scene: Scene, state: NetworkState, promises: Promises) -> Floats:
    """Directions (m, 3) in which promised points can be seen: today's ray, or else the normal."""
    source = scene.subject.design_points
    way = centres_mm(scene, state)[promises.camera] - source.points_mm[promises.point]
    return np.where(promises.kept[:, None], way, source.normals[promises.point])
