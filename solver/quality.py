"""Every figure of a given network: what ``evaluate`` and ``design`` both report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Bools, Floats
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import blur_disk_mm, depth_of_field_mm, ground_sample_distance_mm
from geometry.subject import Subject
from solver.constraints.table import (
    camera_rows,
    constraint_table,
    coverage_rows,
    place_rows,
    row,
)
from solver.coverage.matchable import Matchable, MatchableViews
from solver.coverage.views import in_frame
from solver.coverage.visibility import cast_rays
from solver.information import normal_matrices
from solver.limits import Limits
from solver.motion import HeadPosition
from solver.problem import Problem
from solver.result import (
    CameraTable,
    ConstraintRow,
    CoverageShare,
    PointTable,
    Quality,
    Sense,
)


@dataclass(frozen=True, eq=False)
class Observations:
    """What the cameras see of the check points in one head position, each (n, q).

    ``visible``: facing with a free line of sight; ``framed``: visible and in frame; ``sharp``:
    framed and in focus; ``cosine`` of the angle of incidence; ``depth_mm`` along the axis.
    """

    visible: Bools
    framed: Bools
    sharp: Bools
    cosine: Floats
    depth_mm: Floats

    @classmethod
    def of(cls, problem: Problem, position: HeadPosition) -> Observations:
        """Cast all rays with the head in one position."""
        source, occluder = problem.subject.check_points, problem.subject.occluder
        centres = np.stack([c.pose.position_rig_mm for c in problem.cameras])
        found = cast_rays(
            source, occluder, centres, problem.limits.incidence.ray_max_deg, (position,)
        )
        points = position.points(source.points_mm)
        framed, sharp, depth = found.seen.copy(), found.seen.copy(), np.empty(found.seen.shape)
        for i, camera in enumerate(problem.cameras):
            depth[i] = camera.pose.to_camera(points)[:, 2]
            framed[i] &= in_frame(camera, points)
            sharp[i] = framed[i] & is_sharp(camera, depth[i])
        return cls(found.seen, framed, sharp, found.cosine, depth)

    @classmethod
    def stacked(cls, parts: Sequence[Observations]) -> Observations:
        """What the cameras of all parts see, in their order."""
        return cls(
            np.concatenate([p.visible for p in parts]),
            np.concatenate([p.framed for p in parts]),
            np.concatenate([p.sharp for p in parts]),
            np.concatenate([p.cosine for p in parts]),
            np.concatenate([p.depth_mm for p in parts]),
        )


def is_sharp(camera: RigCamera, depth_mm: Floats) -> Bools:
    """Whether points at the given depths are within the circle of confusion, (n,)."""
    kind = camera.camera
    with np.errstate(divide="ignore", invalid="ignore"):
        blur = blur_disk_mm(depth_mm, camera.focus_distance_mm, kind.focal_length_mm, kind.f_number)
    # A micrometre of a micrometre: what rounding does to a point exactly on the limit.
    return np.asarray((depth_mm > 0.0) & (blur <= kind.circle_of_confusion_mm * (1.0 + 1e-6)))


def evaluate(
    subject: Subject,
    cameras: tuple[RigCamera, ...],
    limits: Limits,
    anchor: tuple[Pose, ...] | None = None,
) -> Quality:
    """Score any given network.

    ``anchor`` are the poses about which Eq 8 bounds the cameras; without it those bounds are
    not judged. Raises :class:`InputError` when there are no cameras or two share a name.
    """
    _must_be_named(cameras)
    problem = Problem(subject, cameras, limits, anchor)
    found = [Observations.of(problem, position) for position in problem.visibility_positions]
    rest = found[0]
    points = _points(problem, rest)
    seen = int(rest.visible.sum())
    coverage = _coverage(problem, found)
    judged = _matchable(problem, found)
    return Quality(
        cost_mm2=float(points.norm_mm2.mean()),
        sigma_median_mm=float(np.median(points.sigma_mm)),
        sigma_p95_mm=float(np.percentile(points.sigma_mm, 95.0)),
        sigma_max_mm=float(points.sigma_mm.max()),
        coverage=coverage,
        in_focus_share=float(rest.sharp.sum() / max(1, int(rest.framed.sum()))),
        in_frame_share=float(rest.framed.sum() / max(1, seen)),
        base_height=base_height_table(cameras, subject.design_points.centroid_mm),
        convergence_deg=convergence_table(cameras, subject.design_points.centroid_mm),
        cameras=_cameras(problem, rest),
        points=points,
        constraints=(
            *constraint_table(problem, [f.visible for f in found], coverage),
            *_matching_rows(judged),
        ),
        matchable=judged,
    )


def keeps_limits(subject: Subject, cameras: tuple[RigCamera, ...], limits: Limits) -> bool:
    """Whether a network is feasible, as :func:`evaluate` says, without the figures of its points.

    For many trials of one rig: the cheapest limits come first, and the first one that is broken
    ends it.
    """
    _must_be_named(cameras)
    problem = Problem(subject, cameras, limits)
    return all(row.satisfied for row in _cheapest_first(problem))


def _cheapest_first(problem: Problem) -> Iterator[ConstraintRow]:
    """All limits but the bounds about an anchor, each with no more work than it needs."""
    yield from place_rows(problem)
    positions = problem.visibility_positions
    each: list[list[Observations]] = []
    for camera in problem.cameras:
        # Its depths are in millimetres: that it stands alone in this problem changes no ray.
        alone = Problem(problem.subject, (camera,), problem.limits)
        each.append([Observations.of(alone, position) for position in positions])
        seen = np.logical_or.reduce([sight.visible[0] for sight in each[-1]])
        yield from camera_rows(problem, camera, seen)
    found = [Observations.stacked(sights) for sights in zip(*each, strict=True)]
    yield from coverage_rows(problem, _coverage(problem, found))
    if problem.limits.matching.demanded:
        yield from _matching_rows(_matchable(problem, found))


def _must_be_named(cameras: tuple[RigCamera, ...]) -> None:
    if not cameras:
        raise InputError(
            "no-cameras", "there are no cameras to evaluate", "give at least one camera"
        )
    names = [c.name for c in cameras]
    if len(set(names)) < len(names):
        raise InputError(
            "camera-names", "two cameras have the same name", "give every camera its own name"
        )


def _matchable(problem: Problem, found: list[Observations]) -> Matchable:
    positions = zip(problem.visibility_positions, found, strict=True)
    views = tuple(matchable_views(problem, position, f) for position, f in positions)
    return Matchable(problem.subject, problem.limits, views)


def _matching_rows(matchable: Matchable) -> tuple[ConstraintRow, ...]:
    """The limits on matching, where they are limits."""
    tiers = matchable.limits.matching.demanded
    if not tiers:
        return ()
    groups = float(len(matchable.groups))
    return (
        *(
            row(
                f"matchable_{t.pairs}/all",
                matchable.share(t.pairs),
                t.share,
                Sense.AT_LEAST,
                "",
                1.0,
            )
            for t in tiers
        ),
        row("groups/all", groups, 1.0, Sense.AT_MOST, "", 1.0),
    )


def matchable_views(
    problem: Problem, position: HeadPosition, found: Observations
) -> MatchableViews:
    """What a matcher could use of what the cameras see with the head in one position."""
    matching = problem.limits.matching
    usable = found.sharp & (found.cosine >= np.cos(np.radians(matching.max_incidence_deg)))
    focal = np.array([c.camera.focal_length_px for c in problem.cameras])
    centres = np.stack([c.pose.position_rig_mm for c in problem.cameras])
    points = position.points(problem.subject.check_points.points_mm)
    return MatchableViews(matching, usable, centres, points, found.depth_mm / focal[:, None])


def _coverage(problem: Problem, found: list[Observations]) -> tuple[CoverageShare, ...]:
    """Shares of points in so many views or more, at the worst head position."""
    counts = [f.framed.sum(axis=0) for f in found]
    most = max([3, *(t.views for t in problem.limits.coverage.tiers)])
    return tuple(
        CoverageShare(v, min(float((c >= v).mean()) for c in counts))
        for v in range(1, min(most, problem.count) + 1)
    )


def _points(problem: Problem, rest: Observations) -> PointTable:
    source = problem.subject.check_points
    weight = rest.framed * problem.ray_weight[:, None]
    state = problem.unknowns.state(problem.start_values())
    normal = normal_matrices(state, problem.scaled(source.points_mm), weight, problem.prior)
    covariance = np.asarray(np.linalg.inv(normal) * problem.length_mm**2, dtype=np.float64)
    longest = np.linalg.eigvalsh(covariance)[:, -1]
    views, sharp = rest.framed.sum(axis=0), rest.sharp.sum(axis=0)
    return PointTable(source, covariance, np.sqrt(longest), views, sharp)


def base_height_table(cameras: tuple[RigCamera, ...], centroid_mm: Floats) -> Floats:
    """Base over mean distance to the centroid for all pairs, (n, n) with zeros on the diagonal."""
    centres = np.stack([c.pose.position_rig_mm for c in cameras])
    base = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    height = np.linalg.norm(centres - centroid_mm, axis=1)
    return np.asarray(2.0 * base / (height[:, None] + height[None]))


def convergence_table(cameras: tuple[RigCamera, ...], centroid_mm: Floats) -> Floats:
    """Angle at the centroid between the rays to two cameras, degrees, (n, n)."""
    away = np.stack([c.pose.position_rig_mm for c in cameras]) - centroid_mm
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    angles = np.degrees(np.arccos(np.clip(away @ away.T, -1.0, 1.0)))
    np.fill_diagonal(angles, 0.0)
    return np.asarray(angles)


def _cameras(problem: Problem, rest: Observations) -> CameraTable:
    n = problem.count
    gsd, incidence, depth = (
        np.full((n, 3), np.nan),
        np.full((n, 2), np.nan),
        np.full((n, 2), np.nan),
    )
    focus = np.empty((n, 2))
    for i, c in enumerate(problem.cameras):
        kind = c.camera
        focus[i] = depth_of_field_mm(
            c.focus_distance_mm, kind.focal_length_mm, kind.f_number, kind.circle_of_confusion_mm
        )
        rows = rest.framed[i]
        if not rows.any():
            continue
        z = rest.depth_mm[i, rows]
        pixel = ground_sample_distance_mm(z, kind.focal_length_px)
        angle = np.degrees(np.arccos(np.clip(rest.cosine[i, rows], -1.0, 1.0)))
        gsd[i] = pixel.min(), pixel.mean(), pixel.max()
        incidence[i] = angle.mean(), angle.max()
        depth[i] = z.min(), z.max()
    centres = np.stack([c.pose.position_rig_mm for c in problem.cameras])
    distance = np.linalg.norm(centres - problem.origin_mm, axis=1)
    roll = np.array([c.pose.pan_tilt_roll_deg[2] for c in problem.cameras])
    seen, gap = rest.framed.sum(axis=1), nearest_body_mm(problem)
    return CameraTable(seen, gsd, incidence, depth, focus, distance, gap, roll)


def nearest_body_mm(problem: Problem) -> Floats:
    """Clearance (n,) of each body's sphere cover to the nearest other one, infinite if alone."""
    centres = [
        c.pose.to_rig(o * problem.length_mm)
        for c, (o, _) in zip(problem.cameras, problem.spheres, strict=True)
    ]
    radii = [r * problem.length_mm for _, r in problem.spheres]
    out = np.full(problem.count, np.inf)
    for i in range(problem.count):
        for k in range(i):
            gap = np.linalg.norm(centres[i][:, None] - centres[k][None], axis=2)
            least = float((gap - radii[i][:, None] - radii[k][None]).min())
            out[i], out[k] = min(out[i], least), min(out[k], least)
    return out
