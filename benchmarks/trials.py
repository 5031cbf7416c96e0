"""Trials of the check: a disturbed rig, a reference drawn from its covariance, and the verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import numpy as np
from synthetic_scenes import Scene, face_scene, plate_places, turned

from calibration.adjustment import Calibration, CalibrationOptions, calibrate
from calibration.adjustment.forward import intersected
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.rotations import rotation_of, similarity
from calibration.check.checking import CheckOptions, judge
from calibration.check.diagnosis import Prepared, diagnose
from calibration.check.epoch import Epoch, epoch_of
from calibration.check.gross import corrected_epoch
from calibration.check.verdicts import CheckResult, Kind, Light
from geometry.arrays import Floats, Ints
from geometry.frames import Pose

REFERENCE_FRAMES = 12
CHECK_FRAMES = 4
URAD = 1e-6


@dataclass(frozen=True, eq=False)
class Bench:
    """A reference, the scene of its checks, and what does not change between trials."""

    calibration: Calibration
    scene: Scene
    index: Ints
    epoch: Epoch
    prepared: Prepared
    sigma_px: float

    @classmethod
    def of(cls, sigma_px: float, rings: int = 60, check_frames: int = CHECK_FRAMES) -> Bench:
        """The 7-camera rig, calibrated with a plate in 12 places and ``rings`` ring targets.

        The calibration found is taken as the truth of the trials: its covariance then is that of
        the references drawn about it.
        """
        scene = face_scene(rings=rings, frames=REFERENCE_FRAMES)
        options = CalibrationOptions(start=scene.cameras, cross_validate=False)
        calibration = calibrate(scene.observe(sigma_px, 1), options)
        truth = replace(
            scene,
            cameras=calibration.cameras,
            true_mm=calibration.target_mm,
            places=(scene.places[0], plate_places(max(check_frames, 1), 99)),
        )
        if check_frames == 0:
            keep = len(truth.targets.carriers[0].ids)
            targets = replace(truth.targets, carriers=truth.targets.carriers[:1])
            truth = replace(
                truth, targets=targets, true_mm=truth.true_mm[:keep], places=truth.places[:1]
            )
        observations = truth.observe(sigma_px, 2)
        epoch = epoch_of(calibration, observations)
        righted = corrected_epoch(epoch)
        first = diagnose(righted.epoch, righted.start.state).first
        prepared = Prepared.of(righted.epoch, first.state)
        return cls(calibration, truth, truth.exact()[0], epoch, prepared, sigma_px)

    def trial(self, scene: Scene, rng: np.random.Generator) -> CheckResult:
        """One check of a disturbed scene against a fresh draw of the reference."""
        index, exact = scene.exact()
        pixels = exact + self.sigma_px * rng.normal(size=exact.shape)
        observations = scene.observations(index, pixels, self.sigma_px)
        same = np.array_equal(index, self.index)
        base = self.epoch if same else epoch_of(self.calibration, observations)
        righted = corrected_epoch(base.with_pixels(pixels, base.reference.drawn(rng)))
        touched = righted.cameras or righted.ids or righted.scales or righted.pictures or not same
        diagnosis = diagnose(
            righted.epoch,
            righted.start.state,
            righted.suspects,
            None if touched else self.prepared,
        )
        return judge(
            self.calibration,
            observations,
            base,
            righted,
            diagnosis,
            CheckOptions(),
            righted.pictures,
        )


@dataclass(frozen=True, eq=False)
class Disturbed:
    """A disturbed scene and the verdict that is right for it."""

    scene: Scene
    kind: Kind
    subjects: frozenset[str]


Disturb = Callable[[Scene, np.random.Generator], Disturbed]


def _moved(scene: Scene, which: list[int], translation_mm: Floats, turn_rad: Floats) -> Disturbed:
    cameras = list(scene.cameras)
    for k, shift, turn in zip(which, translation_mm, turn_rad, strict=True):
        cameras[k] = turned(cameras[k], shift, turn)
    names = frozenset(scene.cameras[k].name for k in which)
    return Disturbed(scene.with_cameras(tuple(cameras)), Kind.CAMERA_MOVED, names)


def unit(rng: np.random.Generator, axes: int) -> Floats:
    """A random direction among the first axes of a camera, (3,)."""
    way = np.zeros(3)
    way[:axes] = rng.normal(size=axes)
    return np.asarray(way / np.linalg.norm(way))


def nothing(scene: Scene, rng: np.random.Generator) -> Disturbed:
    """The whole rig shifted and turned: harmless."""
    turn = rotation_of(1e-3 * rng.normal(size=3))
    shift = rng.normal(size=3)
    cameras = tuple(
        replace(
            c,
            pose=Pose(
                turn @ c.pose.position_rig_mm + shift, c.pose.rotation_rig_to_camera @ turn.T
            ),
        )
        for c in scene.cameras
    )
    names = frozenset(c.name for c in cameras)
    return Disturbed(scene.with_cameras(cameras), Kind.FINE, names)


def camera_turned(urad: float) -> Disturb:
    """One camera turned about a random axis across its view."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        camera = int(rng.integers(len(scene.cameras)))
        turn = urad * URAD * unit(rng, 2)
        return _moved(scene, [camera], np.zeros((1, 3)), turn[None])

    return disturb


def camera_shifted(um: float, axes: int = 3) -> Disturb:
    """One camera shifted in a random direction (of all three axes, or across its view)."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        camera = int(rng.integers(len(scene.cameras)))
        shift = 1e-3 * um * unit(rng, axes)
        return _moved(scene, [camera], shift[None], np.zeros((1, 3)))

    return disturb


def group_moved(most_mm: float, most_mrad: float) -> Disturb:
    """Two to four neighbours moved as one body, by a random part of a shift and a turn."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        count = int(rng.integers(2, 5))
        first = int(rng.integers(len(scene.cameras) - count + 1))
        which = list(range(first, first + count))
        shift = most_mm * rng.uniform() * unit(rng, 3)
        turn = rotation_of(1e-3 * most_mrad * rng.uniform() * unit(rng, 3))
        middle = np.mean([scene.cameras[k].pose.position_rig_mm for k in which], axis=0)
        cameras = list(scene.cameras)
        for k in which:
            pose = cameras[k].pose
            place = middle + turn @ (pose.position_rig_mm - middle) + shift
            moved = Pose(place, pose.rotation_rig_to_camera @ turn.T)
            cameras[k] = replace(cameras[k], pose=moved)
        names = frozenset(scene.cameras[k].name for k in which)
        return Disturbed(scene.with_cameras(tuple(cameras)), Kind.CAMERA_MOVED, names)

    return disturb


def face_error_mm(before: Scene, after: Scene) -> float:
    """Largest error of a face that the rig of ``after`` photographs and ``before`` computes.

    The face is half an ellipsoid of 150 x 200 x 180 mm about the rig's origin; its points are
    intersected from the cameras that look at their skin within 60 degrees, two at least. A motion
    of the face as a whole is no error.
    """
    angle = np.radians(np.linspace(-80.0, 80.0, 23))
    height = np.radians(np.linspace(-60.0, 60.0, 17))
    a, h = (v.ravel() for v in np.meshgrid(angle, height))
    normal = np.stack([np.sin(a) * np.cos(h), -np.cos(a) * np.cos(h), np.sin(h)], axis=1)
    half = np.array([75.0, 90.0, 100.0])
    points = half * normal
    outward = normal / half
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    rows, pixels, numbers = [], [], []
    for k, camera in enumerate(after.cameras):
        to_camera = camera.pose.position_rig_mm - points
        to_camera /= np.linalg.norm(to_camera, axis=1, keepdims=True)
        seen = np.flatnonzero(np.einsum("pi,pi->p", to_camera, outward) > 0.5)
        rows.append(np.full(len(seen), k))
        numbers.append(seen)
        pixels.append(camera.project(points[seen]))
    pixel = np.concatenate(pixels)
    found = intersected(
        before.cameras,
        np.concatenate(rows),
        np.concatenate(numbers),
        pixel,
        np.ones_like(pixel),
        len(points),
    ).position_rig_mm
    good = np.isfinite(found).all(axis=1)
    _, rotation, shift = similarity(found[good], points[good])
    left = found[good] @ rotation.T + shift - points[good]
    return float(np.linalg.norm(left, axis=1).max())


def two_cameras(urad: float, um: float) -> Disturb:
    """Two cameras, each turned or shifted in directions of their own."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        which = [int(k) for k in rng.choice(len(scene.cameras), 2, replace=False)]
        # Not both at once in one camera: a turn can undo what a shift does to its image.
        turns = rng.integers(2, size=(2, 1))
        shift = (1 - turns) * 1e-3 * um * np.stack([unit(rng, 3), unit(rng, 3)])
        turn = turns * urad * URAD * np.stack([unit(rng, 2), unit(rng, 2)])
        return _moved(scene, which, shift, turn)

    return disturb


def focus(share: float) -> Disturb:
    """One lens refocused: another focal length, and the axis a little elsewhere."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        k = int(rng.integers(len(scene.cameras)))
        camera = scene.cameras[k]
        interior = replace(
            camera.interior,
            focal_length_px=camera.interior.focal_length_px * (1.0 + share * rng.choice([-1, 1])),
            principal_point_px=camera.interior.principal_point_px + rng.normal(size=2),
        )
        cameras = list(scene.cameras)
        cameras[k] = replace(camera, interior=interior)
        changed = scene.with_cameras(tuple(cameras))
        return Disturbed(changed, Kind.LENS_CHANGED, frozenset({camera.name}))

    return disturb


def bent(sag_mm: float) -> Disturb:
    """The plate bent into a dish, a saddle or something between, by ``sag_mm`` at its corners."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        own = scene.targets.carrier_of == 1
        true = scene.true_mm.copy()
        x, y = (true[own, :2] - true[own, :2].mean(axis=0)).T
        a, b, c = rng.normal(size=3)
        form = a * x * x + b * x * y + c * y * y
        true[own, 2] += sag_mm * form / np.abs(form).max()
        return Disturbed(replace(scene, true_mm=true), Kind.CARRIER_BENT, frozenset({"plate"}))

    return disturb


def ids_swapped(scene: Scene, rng: np.random.Generator) -> Disturbed:
    """Two targets of one carrier carry each other's ids."""
    carrier = int(rng.integers(2))
    own = np.flatnonzero(scene.targets.carrier_of == carrier)
    pair = rng.choice(own, 2, replace=False)
    true = scene.true_mm.copy()
    true[pair] = true[pair[::-1]]
    names = frozenset(scene.targets.ids[int(k)] for k in pair)
    return Disturbed(replace(scene, true_mm=true), Kind.IDS_SWAPPED, names)


def printed(scale: float) -> Disturb:
    """The plate printed anew at another scale."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        del rng
        own = scene.targets.carrier_of == 1
        true = scene.true_mm.copy()
        true[own] *= scale
        return Disturbed(replace(scene, true_mm=true), Kind.PRINT_SCALE, frozenset({"plate"}))

    return disturb


def late(milliseconds: float, speed_mm_s: float) -> Disturb:
    """One camera exposes late while the plate is moved about by hand."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        camera = int(rng.integers(len(scene.cameras)))
        seconds = 1e-3 * milliseconds
        seen = {}
        for frame, place in enumerate(scene.places[1]):
            shift = speed_mm_s * seconds * unit(rng, 3)
            turn = rotation_of(0.5 * seconds * rng.normal(size=3))
            seen[camera, frame] = RigidTransform(
                turn @ place.rotation, place.translation_mm + shift
            )
        name = scene.cameras[camera].name
        return Disturbed(
            replace(scene, seen_otherwise=seen), Kind.UNSYNCHRONISED, frozenset({name})
        )

    return disturb


def cameras_swapped(scene: Scene, rng: np.random.Generator) -> Disturbed:
    """Two cameras' images under each other's names."""
    a, b = (int(k) for k in rng.choice(len(scene.cameras), 2, replace=False))
    cameras = list(scene.cameras)
    cameras[a], cameras[b] = (
        replace(cameras[b], name=cameras[a].name),
        replace(cameras[a], name=cameras[b].name),
    )
    names = frozenset({cameras[a].name, cameras[b].name})
    return Disturbed(scene.with_cameras(tuple(cameras)), Kind.CAMERAS_SWAPPED, names)


def target_moved(um: float) -> Disturb:
    """One ring target of the stand knocked."""

    def disturb(scene: Scene, rng: np.random.Generator) -> Disturbed:
        target = int(rng.integers(int((scene.targets.carrier_of == 0).sum())))
        true = scene.true_mm.copy()
        true[target] += 1e-3 * um * unit(rng, 3)
        name = scene.targets.ids[target]
        return Disturbed(replace(scene, true_mm=true), Kind.TARGET_MOVED, frozenset({name}))

    return disturb


@dataclass(frozen=True)
class Tally:
    """What became of ``trials``.

    ``alarmed``: not green; ``kind``: with the right kind among the findings; ``named``: with that
    kind about exactly the right ones; ``alone``: and with nothing else found.
    """

    trials: int
    alarmed: int
    kind: int
    named: int
    alone: int

    def __add__(self, other: Tally) -> Tally:
        """Both together."""
        pairs = zip(astuple(self), astuple(other), strict=True)
        return Tally(*(a + b for a, b in pairs))


def run(bench: Bench, disturb: Disturb, trials: int, seed: int, first: int = 0) -> Tally:
    """Trials from number ``first`` on; a trial's number and the seed make it what it is."""
    total = Tally(0, 0, 0, 0, 0)
    for trial in range(first, first + trials):
        rng = np.random.default_rng([seed, trial])
        disturbed = disturb(bench.scene, rng)
        total += _one(disturbed, bench.trial(disturbed.scene, rng))
    return total


def _one(disturbed: Disturbed, result: CheckResult) -> Tally:
    about = [f for f in result.findings if f.kind is disturbed.kind]
    right = frozenset(s for f in about for s in f.subjects) == disturbed.subjects
    alone = right and len(about) == len(result.findings)
    return Tally(1, result.light is not Light.GREEN, bool(about), right, alone)
