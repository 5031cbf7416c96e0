"""Coverage of a network in the solver's inner loop: who is seen, what is assigned, what is lost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera
from geometry.surface import SurfacePoints
from solver.coverage.assignment import FARTHEST_DEG, AssignedViews, Margins, assign_views
from solver.coverage.matchable import lacks
from solver.coverage.visibility import Visibility, cast_rays, cosines, tangent_planes
from solver.problem import Problem
from solver.variables import NetworkState

FIRST_MARGINS = Margins()
FEW_VIEWS = 2
"""A point with so many views or fewer hangs on each of them."""


@dataclass(frozen=True)
class Reach:
    """How far cameras are expected to move in an outer iteration.

    A free camera has to keep points in frame and in focus up to ``framed_deg`` past the limit of
    incidence. With less, each iteration finds new points just outside the frame; with more,
    cameras stand back for points that they will never see. ``hidden`` ones, too, or only those
    with a free line of sight. Views up to ``assigned_deg`` from being possible may be assigned.
    """

    framed_deg: float
    hidden: bool
    assigned_deg: float


FAR = Reach(15.0, hidden=True, assigned_deg=FARTHEST_DEG)
NEAR = Reach(1.0, hidden=False, assigned_deg=2.0)
NOWHERE = Reach(0.0, hidden=False, assigned_deg=0.0)


@dataclass(frozen=True, eq=False)
class Views:
    """What is seen at one state: ``seen`` (n, p) of the design points, and the views assigned.

    ``framed`` (n, q) are the check points kept in frame and in focus: those that face the
    camera, or would after a small move. Without the latter, every outer iteration would find new
    points just outside the frame.
    """

    seen: Bools
    framed: Bools
    assigned: AssignedViews
    margin_deg: float = 0.0

    def among(self, problem: Problem, chosen: Ints) -> Views:
        """The same views of a scene of whose design points these were the ``chosen`` ones."""
        seen = np.zeros((problem.count, len(problem.subject.design_points)), dtype=np.bool_)
        seen[:, chosen] = self.seen
        assigned = AssignedViews(
            self.assigned.camera, chosen[self.assigned.point], self.assigned.kept
        )
        return Views(seen, self.framed, assigned, self.margin_deg)


def holding_scarce(problem: Problem, seen: Views, most_views: int = FEW_VIEWS) -> Views:
    """The views with those of points that have at most ``most_views`` promised as well.

    Where so few cameras see a point, losing one of them costs more than a good network gains by
    moving; tiers leave such points out, because they are the hardest.
    """
    free = np.array([not c.fixed for c in problem.cameras])
    scarce = seen.seen & (seen.seen.sum(axis=0) <= most_views) & free[:, None]
    scarce[seen.assigned.camera, seen.assigned.point] = False
    camera, point = np.nonzero(scarce)
    return replace(
        seen,
        assigned=AssignedViews(
            np.concatenate([seen.assigned.camera, camera]),
            np.concatenate([seen.assigned.point, point]),
            np.concatenate([seen.assigned.kept, np.ones(len(camera), dtype=np.bool_)]),
        ),
    )


def centres_mm(problem: Problem, state: NetworkState) -> Floats:
    """Projection centres (n, 3) in the rig frame."""
    return np.asarray(state.centre * problem.length_mm + problem.origin_mm)


def in_frame(camera: RigCamera, points_mm: Floats, margin_px: float = 0.0) -> Bools:
    """Which points (n, 3) fall inside a camera's image, (n,)."""
    pixels, depth = camera.camera.project(camera.pose, points_mm)
    w, h = camera.camera.image_size_px
    low, high = margin_px - 0.5, -0.5 - margin_px
    inside = (pixels > low).all(axis=1) & (pixels[:, 0] < w + high) & (pixels[:, 1] < h + high)
    return np.asarray(inside & (depth > 0.0))


def views(
    problem: Problem,
    state: NetworkState,
    earlier: Views | None = None,
    margins: Margins = FIRST_MARGINS,
    reach: Reach = FAR,
) -> Views:
    """Cast all rays and decide which views to assign.

    Free cameras are given frame and focus as limits, so facing and a free line of sight are
    enough; fixed cameras only see what is in their frame. What was framed and assigned in an
    ``earlier`` iteration is held on to, so that the outer loop settles. ``margins`` say what
    is assigned beyond what the tiers ask.
    """
    source = problem.subject.design_points
    limit = problem.limits.incidence.ray_max_deg
    found = cast_rays(
        source,
        problem.subject.occluder,
        centres_mm(problem, state),
        limit,
        problem.visibility_positions,
    )
    seen = found.seen
    for i, camera in enumerate(problem.cameras):
        if camera.fixed:
            seen[i] &= in_frame(camera, source.points_mm)
    fixed = np.array([c.fixed for c in problem.cameras])
    framed = _to_be_framed(problem, state, reach)
    before = None
    if earlier is not None:
        framed, before = framed | earlier.framed, earlier.assigned
    deficits = _deficits(problem, state, found, seen, margins.angle_deg)
    assigned = assign_views(
        problem.limits.coverage.tiers, deficits, fixed, margins.share, before, reach.assigned_deg
    )
    return Views(seen, framed, assigned, margins.angle_deg)


@dataclass(frozen=True, eq=False)
class Judged:
    """Coverage as it will be judged: on the check points, at the worst head position.

    ``shortfall`` is the share by which the worst tier is missed, of views or of matchable pairs, or
    how many groups of cameras there are too many; 0 when all is met;
    ``missed`` are indices of check points that would mend it, the easiest to win first.
    """

    shortfall: float
    missed: Ints


def judge(problem: Problem, state: NetworkState) -> Judged:
    """Count the views of all check points."""
    tiers, source = problem.limits.coverage.tiers, problem.subject.check_points
    worst, missed = 0.0, [np.zeros(0, dtype=np.int64)]
    limit = problem.limits.incidence.ray_max_deg
    asked = bool(tiers) or problem.limits.matching.required
    for position in problem.visibility_positions if asked else ():
        found = cast_rays(
            source, problem.subject.occluder, centres_mm(problem, state), limit, (position,)
        )
        seen = found.seen
        for i, camera in enumerate(problem.cameras):
            if camera.fixed:
                seen[i] &= in_frame(camera, position.points(source.points_mm))
        count = seen.sum(axis=0)
        worst = max([worst, *lacks(problem, state, position, replace(found, free=seen)).values()])
        for tier in tiers:
            lack = tier.share - float((count >= tier.views).mean())
            if lack > 0.0:
                worst = max(worst, lack)
                missed.append(_easiest(found.cosine, count, tier.views, lack))
    return Judged(worst, np.unique(np.concatenate(missed)))


def _easiest(cosine: Floats, count: Ints, views_required: int, lack: float) -> Ints:
    """Check points with too few views that come nearest to having them, enough to mend the lack."""
    poor = np.flatnonzero(count < views_required)
    nth_best = np.sort(cosine[:, poor], axis=0)[-min(views_required, len(cosine))]
    enough = int(np.ceil(1.5 * lack * len(count))) + 2
    return np.asarray(poor[np.argsort(-nth_best, kind="stable")[:enough]])


def with_points(problem: Problem, missed: Ints) -> Problem:
    """The scene with some check points among its design points, so that they are assigned views."""
    if len(missed) == 0:
        return problem
    old, extra = problem.subject.design_points, problem.subject.check_points.subset(missed)
    known = {p.tobytes() for p in old.points_mm}
    fresh = [k for k, p in enumerate(extra.points_mm) if p.tobytes() not in known]
    points = SurfacePoints(
        np.concatenate([old.points_mm, extra.points_mm[fresh]]),
        np.concatenate([old.normals, extra.normals[fresh]]),
    )
    return replace(
        problem,
        subject=replace(problem.subject, design_points=points),
        origin=problem.origin_mm,
        object_points=len(old) if problem.object_points is None else problem.object_points,
    )


def framed_at(problem: Problem, state: NetworkState) -> Bools:
    """Check points (n, q) that each camera sees, in some head position at least."""
    return _to_be_framed(problem, state, NOWHERE)


def _to_be_framed(problem: Problem, state: NetworkState, reach: Reach) -> Bools:
    """Check points (n, q) that may be seen in some head position."""
    source = problem.subject.check_points
    limit = min(problem.limits.incidence.ray_max_deg + reach.framed_deg, 90.0)
    centres = centres_mm(problem, state)
    out = np.zeros((problem.count, len(source)), dtype=np.bool_)
    for position in problem.visibility_positions:
        if reach.hidden:
            for i, centre in enumerate(centres):
                eye = position.eye_seen_by_head(centre)
                out[i] |= cosines(source, eye) > np.cos(np.radians(limit))
        else:
            occluder = problem.subject.occluder
            out |= cast_rays(source, occluder, centres, limit, (position,)).seen
    return out


def _deficits(
    problem: Problem, state: NetworkState, found: Visibility, seen: Bools, margin_deg: float
) -> Floats:
    """How far each camera is from seeing each point, (n, p) degrees; see :func:`assign_views`."""
    limit = problem.limits.incidence.ray_max_deg - margin_deg
    incidence = np.degrees(np.arccos(np.clip(found.cosine, -1.0, 1.0)))
    out = np.where(seen, incidence - limit - 1e-9, np.inf)
    most = max((t.views for t in problem.limits.coverage.tiers), default=0)
    poor = (out <= 0.0).sum(axis=0) < min(most, problem.count)
    camera, point = np.nonzero(~seen & poor)
    if len(camera) == 0:
        return out
    source = problem.subject.design_points
    eyes = centres_mm(problem, state)[camera]
    hidden = tangent_planes(source, problem.subject.occluder, point, eyes, source.normals[point])
    facing = np.maximum(0.0, incidence[camera, point] - limit)
    out[camera, point] = np.maximum(hidden.deficit_deg, facing) + 1e-6
    return out
