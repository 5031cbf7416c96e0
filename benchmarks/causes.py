"""Whether the check tells what happened first and alone: many causes at random sizes, simulated.

    python -m benchmarks.causes [--trials 100] [--causes late dirty] [--groups 100] [--verbose]

Fixed seeds. Groups of two to four cameras that moved together are judged against the error that
they truly make: points of a face, each seen by the cameras that look at it, intersected with the
old calibration. A check that refuses its pictures has told nothing.
"""

from __future__ import annotations

import argparse
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import numpy as np
from calibrations import check_scene, small_scene
from synthetic_scenes import Scene

from benchmarks.pages import table
from calibration.adjustment import Calibration, CalibrationOptions, calibrate
from calibration.adjustment.initialisation.rays import nearest_points
from calibration.adjustment.rotations import rotation_of, similarity
from calibration.check import CheckOptions, CheckResult, Kind, Light, check
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats, Ints
from geometry.frames import Pose

SIGMA_PX, BLUR_PX, REFERENCES = 0.1, 0.8, 40
FACE_MM, FACE_POINTS, WIDEST_DEG = 90.0, 200, 65.0

Random = np.random.Generator
LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Case:
    """What the check is shown, and the finding that must come first: its kind and its words."""

    observations: Observations
    kind: Kind
    words: str


Disturb = Callable[[Random], Case]


def observed(scene: Scene, random: Random) -> Observations:
    """The scene with noise, its edges as sharp as in the reference."""
    seen = scene.observe(SIGMA_PX, int(random.integers(1 << 30)))
    return replace(seen, blur_px=np.full(len(seen.pixel), BLUR_PX))


def _one(random: Random) -> int:
    return int(random.integers(len(check_scene().cameras)))


def with_pixels(random: Random, change: Callable[[Floats, Ints], Floats]) -> Observations:
    """One camera's pixels changed; those that leave its picture are lost."""
    seen, camera = observed(check_scene(), random), _one(random)
    pixel, own, size = seen.pixel.copy(), seen.camera == camera, seen.image_size_px[camera]
    pixel[own] = change(pixel[own], size)
    inside = ((pixel >= 0.0) & (pixel <= seen.image_size_px[seen.camera] - 1.0)).all(axis=1)
    return replace(seen, pixel=np.clip(pixel, 0.0, None)).subset(np.flatnonzero(inside))


def blurred(random: Random) -> Case:
    """A camera out of focus by 2 to 4 px."""
    seen, blur = observed(check_scene(), random), random.uniform(2.0, 4.0)
    own = np.flatnonzero(seen.camera == _one(random))
    return Case(_soft(seen, own, blur, random), Kind.BLURRED, "out of focus")


def dirty(random: Random) -> Case:
    """Dirt on a tenth to a half of a picture."""
    seen, share = observed(check_scene(), random), random.uniform(0.1, 0.5)
    own = np.flatnonzero(seen.camera == _one(random))
    along = seen.pixel[own] @ random.normal(size=2)
    soft = own[along < np.quantile(along, share)]
    return Case(_soft(seen, soft, random.uniform(2.0, 4.0), random), Kind.BLURRED, "")


def _soft(seen: Observations, rows: Ints, blur: float, random: Random) -> Observations:
    """Soft edges: a bias that they share, and more noise."""
    pixel, edges = seen.pixel.copy(), np.array(seen.blur_px)
    pixel[rows] += random.normal(0.0, 0.4, 2) + random.normal(0.0, 0.2 * blur, (len(rows), 2))
    edges[rows] = blur
    return replace(seen, pixel=pixel, blur_px=edges)


def quarter(random: Random) -> Case:
    """Pictures of a camera turned by 90 or 270 degrees."""
    sign = float(random.choice([-1.0, 1.0]))
    turn = np.array([[0.0, sign], [-sign, 0.0]])
    seen = with_pixels(random, lambda p, s: (p - s / 2.0) @ turn + s / 2.0)
    return Case(seen, Kind.LENS_CHANGED, "degrees")


def cropped(random: Random) -> Case:
    """Pictures cut out 4 to 40 px farther to one side."""
    shift = random.uniform(4.0, 40.0, 2) * random.choice([-1.0, 1.0], 2)
    return Case(with_pixels(random, lambda p, _: p - np.rint(shift)), Kind.LENS_CHANGED, "shifted")


def late(random: Random) -> Case:
    """A camera one frame late or early."""
    places, step = check_scene().places[1], int(random.choice([-1, 1]))
    last, camera = len(places) - 1, _one(random)
    other = {(camera, f): places[min(max(f - step, 0), last)] for f in range(last + 1)}
    scene = replace(check_scene(), seen_otherwise=other)
    return Case(observed(scene, random), Kind.UNSYNCHRONISED, "one frame")


def backwards(random: Random) -> Case:
    """A folder in the opposite order."""
    places, camera = check_scene().places[1], _one(random)
    other = {(camera, f): places[len(places) - 1 - f] for f in range(len(places))}
    scene = replace(check_scene(), seen_otherwise=other)
    return Case(observed(scene, random), Kind.UNSYNCHRONISED, "opposite order")


def folders(random: Random) -> Case:
    """All folders in another order."""
    own = check_scene().cameras
    order = random.permutation(len(own))
    while (order == np.arange(len(own))).any():
        order = random.permutation(len(own))
    cameras = tuple(replace(own[k], name=c.name) for k, c in zip(order, own, strict=True))
    return Case(observed(check_scene().with_cameras(cameras), random), Kind.CAMERAS_SWAPPED, "")


def all_scales(random: Random) -> Case:
    """All focal lengths changed by one factor, 300 to 2000 ppm."""
    return _scaled(random, 3e-4, 2e-3)


def _scaled(random: Random, least: float, most: float) -> Case:
    factor = 1.0 + random.uniform(least, most) * random.choice([-1.0, 1.0])
    cameras = tuple(
        replace(
            c, interior=replace(c.interior, focal_length_px=c.interior.focal_length_px * factor)
        )
        for c in check_scene().cameras
    )
    seen = observed(check_scene().with_cameras(cameras), random)
    return Case(seen, Kind.LENS_CHANGED, "focal lengths of all cameras")


def binned(random: Random) -> Case:
    """Pictures of a camera binned by 2, 3 or 4."""
    seen, camera, factor = observed(check_scene(), random), _one(random), int(random.integers(2, 5))
    pixel, own, sizes = seen.pixel.copy(), seen.camera == camera, seen.image_size_px.copy()
    pixel[own] = (pixel[own] + 0.5) / factor - 0.5
    sizes[camera] //= factor
    seen = replace(seen, pixel=np.clip(pixel, 0.0, None), image_size_px=sizes)
    return Case(seen, Kind.LENS_CHANGED, "binning")


def _of_all(random: Random, change: Callable[[Floats, Ints], Floats]) -> Observations:
    seen = observed(check_scene(), random)
    sizes = seen.image_size_px[seen.camera]
    pixel = change(seen.pixel, sizes)
    inside = ((pixel >= 0.0) & (pixel <= sizes - 1.0)).all(axis=1)
    return replace(seen, pixel=np.clip(pixel, 0.0, None)).subset(np.flatnonzero(inside))


def all_cropped(random: Random) -> Case:
    """Pictures of all cameras cut out 4 to 40 px farther to one side."""
    shift = random.uniform(4.0, 40.0, 2) * random.choice([-1.0, 1.0], 2)
    seen = _of_all(random, lambda p, _: p - np.rint(shift))
    return Case(seen, Kind.LENS_CHANGED, "all cameras are shifted")


def all_turned(random: Random) -> Case:
    """Pictures of all cameras turned by 180 degrees."""
    seen = _of_all(random, lambda p, s: s - 1.0 - p)
    return Case(seen, Kind.LENS_CHANGED, "all cameras are turned by 180")


def all_resized(random: Random) -> Case:
    """All focal lengths changed by one factor, 0.3 to 30 %."""
    return _scaled(random, 3e-3, 0.3)


def late_pair(random: Random) -> Case:
    """Two cameras one frame late or early."""
    places, cameras = check_scene().places[1], random.choice(5, 2, replace=False)
    last = len(places) - 1
    other = {}
    for camera in cameras.tolist():
        step = int(random.choice([-1, 1]))
        other |= {(camera, f): places[min(max(f - step, 0), last)] for f in range(last + 1)}
    scene = replace(check_scene(), seen_otherwise=other)
    return Case(observed(scene, random), Kind.UNSYNCHRONISED, "one frame")


def missing(random: Random) -> Case:
    """A camera without pictures."""
    seen = observed(check_scene(), random)
    rows = np.flatnonzero(seen.camera != _one(random))
    return Case(seen.subset(rows), Kind.CAMERA_MISSING, "")


CAUSES: tuple[Disturb, ...] = (
    blurred,
    dirty,
    quarter,
    cropped,
    late,
    backwards,
    folders,
    all_scales,
    missing,
    binned,
    all_cropped,
    all_turned,
    all_resized,
    late_pair,
)


@cache
def reference(number: int) -> Calibration:
    """A calibration of the scene by its number: each has errors of its own; its edges are sharp."""
    scene = small_scene()
    options = CalibrationOptions(start=scene.cameras, cross_validate=False)
    done = calibrate(scene.observe(SIGMA_PX, 2000 + number), options)
    return replace(done, blur_px=np.full(len(scene.cameras), BLUR_PX))


def checked(observations: Observations, number: int) -> CheckResult:
    """The verdict of a trial. One reference for all would share its errors among them."""
    return check(reference(number % REFERENCES), observations)


def cause_row(disturb: Disturb, count: int) -> tuple[str, ...]:
    """How often a cause is told first, and alone."""
    first = alone = 0
    for number in range(count):
        case = disturb(np.random.default_rng([CAUSES.index(disturb), number]))
        try:
            result = checked(case.observations, number)
        except InputError as error:
            LOG.info("%s, trial %d: %s", disturb.__name__, number, error)
            continue
        told = result.findings[0].kind is case.kind and case.words in result.sentence
        first += told
        alone += told and set(result.kinds) == {case.kind}
        if not told:
            LOG.info("%s, trial %d: %s", disturb.__name__, number, result.sentence)
    words = (disturb.__doc__ or "").strip().rstrip(".")
    return words, str(count), f"{first / count:.0%}", f"{alone / count:.0%}", "95 %"


def moved_together(random: Random) -> Scene:
    """Two to four cameras moved as one body, by up to 0.15 mm and 1 mrad."""
    scene = check_scene()
    cameras, count = list(scene.cameras), int(random.integers(2, 5))
    which = random.choice(len(cameras), count, replace=False)
    size = random.uniform(0.0, 1.0)
    turn = rotation_of(1e-3 * size * random.uniform(-1.0, 1.0, 3))
    shift = 0.15 * size * random.uniform(-1.0, 1.0, 3)
    middle = np.mean([cameras[k].pose.position_rig_mm for k in which], axis=0)
    for k in which:
        pose = cameras[k].pose
        place = middle + turn @ (pose.position_rig_mm - middle) + shift
        cameras[k] = replace(cameras[k], pose=Pose(place, pose.rotation_rig_to_camera @ turn.T))
    return scene.with_cameras(tuple(cameras))


def true_error_mm(scene: Scene) -> float:
    """Largest error of a face's points as the old calibration places them, rigid part taken off."""
    old = check_scene().cameras
    normals = np.random.default_rng(7).normal(size=(FACE_POINTS, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = FACE_MM * normals
    origins, ways, group = [], [], []
    for was, now in zip(old, scene.cameras, strict=True):
        to_camera = was.pose.position_rig_mm - points
        to_camera /= np.linalg.norm(to_camera, axis=1, keepdims=True)
        sees = np.einsum("pi,pi->p", to_camera, normals) > np.cos(np.radians(WIDEST_DEG))
        pixels = now.project(points[sees])
        ways.append(was.rays(pixels))
        origins.append(np.broadcast_to(was.pose.position_rig_mm, ways[-1].shape))
        group.append(np.flatnonzero(sees))
    found = nearest_points(
        np.concatenate(origins), np.concatenate(ways), np.concatenate(group), FACE_POINTS
    )
    good = np.isfinite(found).all(axis=1)
    _, rotation, translation = similarity(points[good], found[good])
    left = found[good] - (points[good] @ rotation.T + translation)
    return float(np.linalg.norm(left, axis=1).max())


def group_rows(count: int) -> list[tuple[str, ...]]:
    """Groups that matter must be red; a rig in which nothing moved must not alarm."""
    tolerance = CheckOptions().tolerance_mm
    matter = red = false = 0
    for number in range(count):
        random = np.random.default_rng([50, number])
        scene = moved_together(random)
        error_mm = true_error_mm(scene)
        if error_mm > tolerance:
            matter += 1
            result = checked(observed(scene, random), number)
            red += result.light is Light.RED
            if result.light is not Light.RED:
                LOG.info("group, trial %d, %.3f mm: %s", number, error_mm, result.sentence)
        false += checked(observed(check_scene(), random), number).light is not Light.GREEN
    return [
        (
            f"Groups whose true error is above {1e3 * tolerance:.0f} um: red",
            str(matter),
            f"{red / max(matter, 1):.0%}",
            "",
            "95 %",
        ),
        ("Nothing: an alarm", str(count), f"{false / count:.1%}", "", "0.1 %"),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--verbose", action="store_true", help="each trial that was not told")
    names = [disturb.__name__ for disturb in CAUSES]
    parser.add_argument("--causes", nargs="*", choices=names, default=names)
    parser.add_argument("--groups", type=int, help="trials of groups; as many as of causes")
    asked = parser.parse_args()
    logging.basicConfig(level=logging.INFO if asked.verbose else logging.WARNING)
    rows = [cause_row(d, asked.trials) for d in CAUSES if d.__name__ in asked.causes]
    groups = asked.trials if asked.groups is None else asked.groups
    rows += group_rows(groups) if groups else []
    print(table(("what happened", "trials", "told first", "told alone", "asked"), rows))


if __name__ == "__main__":
    main()
