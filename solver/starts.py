"""Where a design starts: k-means (Eqs 1-3), jittered k-means, the conventional strip."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial.transform import Rotation

from geometry.arrays import Floats
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose, look_at_rotation
from geometry.optics import blur_ratio
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.limits import ROLL_TOLERANCE_DEG, Limits
from solver.problem import camera_at

_FARTHEST_RADII = 100.0
_JITTER_DEG = 12.0
_JITTER_DISTANCE = 0.06
_STRIP_SPANS_DEG = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0, 105.0, 120.0, 140.0)


def axis_rotation(forward: Floats) -> Floats:
    """Eqs 1-3: ``rotation_rig_to_camera`` (3, 3) of a camera that looks along ``forward``.

    Rodrigues' formula turns the nadir axis [0 0 -1] of photogrammetry into the viewing
    direction by the shortest way, which leaves the roll to chance; as rigs are built level, the
    roll is then set level, which the paper's bounds on kappa do by hand.
    """
    return look_at_rotation(np.zeros(3), forward)


def fitting_distance(
    camera: Camera,
    limits: Limits,
    points_mm: Floats,
    forward: Floats,
    roll_deg: float,
    target_mm: Floats | None = None,
) -> float:
    """Smallest distance at which all points are in frame and can be in focus.

    The camera looks at ``target_mm``, or the centroid, from that far along ``forward`` (3,).
    Within the stand-off limits, unless the frame alone asks for more.
    """
    rotation = look_at_rotation(np.zeros(3), forward, roll_deg)
    middle = points_mm.mean(axis=0) if target_mm is None else target_mm
    local = (points_mm - middle) @ rotation.T
    margin = 0.0 if limits.frame is None else limits.frame.margin_px
    left, right, top, bottom = _frame_limits(camera, margin)
    # x / (z + D) <= right, and so on, solved for D.
    needed = [local[:, 0] / right, local[:, 0] / left, local[:, 1] / bottom, local[:, 1] / top]
    frame = float((np.stack(needed) - local[:, 2]).max())
    radius = float(np.abs(local).max())
    low = max(frame, radius * 1.05, limits.stand_off.min_mm or 0.0)
    high = max(low, limits.stand_off.max_mm or _FARTHEST_RADII * radius)
    nearest, farthest = float(local[:, 2].min()), float(local[:, 2].max())
    if limits.depth_of_field and not _sharp(camera, low + nearest, low + farthest):
        far = high
        for _ in range(60):
            middle_distance = 0.5 * (low + far)
            if _sharp(camera, middle_distance + nearest, middle_distance + farthest):
                far = middle_distance
            else:
                low = middle_distance
        low = far
    return min(low, high)


@lru_cache(maxsize=16)
def _frame_limits(camera: Camera, margin_px: float) -> Floats:
    """Kept: a search asks a thousand times for those of one camera."""
    return camera.frame_limits(margin_px)


def _sharp(camera: Camera, near: float, far: float) -> bool:
    """Whether some focus distance makes depths from ``near`` to ``far`` sharp."""
    # Both limits bind at the harmonic mean: s/(1+k) = near and s/(1-k) = far.
    focus = camera.focus_distance_mm or max(
        2.0 * near * far / (near + far), camera.min_focus_distance_mm
    )
    k = blur_ratio(focus, camera.focal_length_mm, camera.f_number, camera.circle_of_confusion_mm)
    return bool(near > 0.0 and focus - near <= k * near and far - focus <= k * far)


def better_roll(
    camera: Camera,
    limits: Limits,
    points_mm: Floats,
    forward: Floats,
    target_mm: Floats | None = None,
) -> tuple[float, float]:
    """0 for landscape or 90 for portrait, whichever lets the camera stand closer, and how close.

    Of those that the limit on roll allows; see :func:`fitting_distance`.
    """
    found = [
        (roll, fitting_distance(camera, limits, points_mm, forward, roll, target_mm))
        for roll in limits.roll.at_start_deg
    ]
    return found[-1] if found[-1][1] < 0.99 * found[0][1] else found[0]


def turned(pose: Pose, limits: Limits) -> Pose:
    """A pose turned about its axis to the nearest roll that the limits allow.

    One within the tolerance stays as it is: what was given and meets the limits is not touched.
    """
    roll = float(pose.pan_tilt_roll_deg[2])
    allowed = limits.roll.nearest_deg(roll)
    if abs((roll - allowed + 180.0) % 360.0 - 180.0) <= ROLL_TOLERANCE_DEG:
        return pose
    return Pose(pose.position_rig_mm, look_at_rotation(np.zeros(3), pose.axis_rig, allowed))


def _clusters(points: SurfacePoints, count: int, seed: int) -> list[tuple[Floats, Floats]]:
    """Centroid and mean normal of each k-means cluster, from the subject's right to left."""
    _, label = kmeans2(points.points_mm, count, seed=seed, minit="++")
    out = []
    for k in range(count):
        mine = label == k
        if not mine.any():
            # Fewer distinct points than cameras: the cluster borrows the whole.
            mine = np.ones(len(points), dtype=np.bool_)
        normal = points.normals[mine].mean(axis=0)
        length = float(np.linalg.norm(normal))
        out.append(
            (
                points.points_mm[mine].mean(axis=0),
                normal / length if length > 1e-9 else -np.eye(3)[1],
            )
        )
    return sorted(out, key=lambda pair: (round(float(pair[0][0]), 6), round(float(pair[0][2]), 6)))


def kmeans_start(
    subject: Subject,
    camera: Camera,
    limits: Limits,
    names: tuple[str, ...],
    seed: int,
    jitter: float = 0.0,
) -> tuple[RigCamera, ...]:
    """A camera per k-means cluster on its mean normal, looking back along it (Eqs 1-3).

    The start distance is the smallest at which the whole region is in frame and in focus.
    ``jitter`` 1 turns the directions by about 12 degrees and changes the distances by 6 %.
    """
    points = subject.design_points
    rng = np.random.default_rng(seed)
    out = []
    for name, (centre, normal) in zip(names, _clusters(points, len(names), seed), strict=True):
        rotation = Rotation.from_rotvec(np.radians(jitter * _JITTER_DEG) * rng.normal(size=3))
        outward = rotation.apply(normal)
        roll, distance = better_roll(camera, limits, points.points_mm, -outward)
        distance *= 1.0 + abs(jitter * _JITTER_DISTANCE * rng.normal())
        position = centre + distance * outward
        pose = Pose(position, look_at_rotation(position, centre, roll))
        out.append(camera_at(camera, name, pose, points.points_mm))
    return tuple(out)


def strip(
    subject: Subject, camera: Camera, limits: Limits, names: tuple[str, ...], span_deg: float
) -> tuple[RigCamera, ...]:
    """A conventional strip: level, equally spaced on an arc of ``span_deg`` about the subject.

    All cameras look at the centroid from the smallest common distance that fits them all.
    """
    middle = subject.design_points.centroid_mm
    turns = np.radians(np.linspace(-span_deg / 2.0, span_deg / 2.0, len(names)))
    facing = subject.design_points.normals.mean(axis=0)[:2]
    heading = np.arctan2(facing[0], -facing[1])
    outward = np.stack(
        [np.sin(turns + heading), -np.cos(turns + heading), np.zeros(len(names))], axis=1
    )
    points = subject.check_points.points_mm
    roll, _ = better_roll(camera, limits, points, -outward[len(names) // 2])
    distance = max(fitting_distance(camera, limits, points, -u, roll, middle) for u in outward)
    poses = [Pose(middle + distance * u, look_at_rotation(np.zeros(3), -u, roll)) for u in outward]
    return tuple(camera_at(camera, n, p, points) for n, p in zip(names, poses, strict=True))


def strips(
    subject: Subject, camera: Camera, limits: Limits, names: tuple[str, ...]
) -> tuple[tuple[RigCamera, ...], ...]:
    """Strips of several spans, of which a builder would take the best."""
    return tuple(strip(subject, camera, limits, names, span) for span in _STRIP_SPANS_DEG)
