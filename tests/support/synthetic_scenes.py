"""Synthetic calibrations: a rig, targets and their images, with the truth known.

Observations are projected, not rendered; this is what the statistics of adjustment and check are
proved with, and what a user can try a target set with before printing it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.rotations import rotation_of
from calibration.observations import Carrier, Distance, Observations, TargetSet
from geometry.arrays import Bools, Floats, Ints
from geometry.frames import Pose

IMAGE_SIZE_PX = (6000, 4000)
PIXEL_PITCH_MM = 0.00375
VOLUME_MM = (300.0, 200.0, 300.0)
"""Width, depth and height of the space round the face that is measured."""


def face_rig(
    count: int = 7, focal_length_mm: float = 50.0, distance_mm: float = 1000.0
) -> tuple[CalibratedCamera, ...]:
    """Cameras on an arc round the face, by turns above and below, 24 MP with 3.75 um pixels."""
    azimuths = np.radians(np.linspace(-55.0, 55.0, count))
    f = focal_length_mm / PIXEL_PITCH_MM
    middle = (np.array(IMAGE_SIZE_PX) - 1.0) / 2.0
    cameras = []
    for k, a in enumerate(azimuths):
        height = (0.22, -0.12)[k % 2]
        way = np.array([np.sin(a), -np.cos(a), height])
        place = distance_mm * way / np.linalg.norm(way)
        # Terms of a good lens: a few pixels at the corner, a centre off by a fraction of a mm.
        offset = 25.0 * np.array([np.cos(1.7 * k), np.sin(2.3 * k)])
        terms = np.array([0.02 + 0.004 * np.cos(k), -0.1, 1e-4, -1e-4, 0.0])
        interior = Interior(f * (1.0 + 1e-3 * np.sin(k)), middle + offset, terms)
        pose = Pose.looking_at(place, np.zeros(3), roll_deg=90.0 * (k % 2))
        cameras.append(CalibratedCamera(f"cam{k + 1}", IMAGE_SIZE_PX, interior, pose))
    return tuple(cameras)


def stand(count: int = 60, seed: int = 3, sigma_mm: float = np.inf) -> tuple[Carrier, Floats]:
    """Ring targets that stand still round the face, and where they are (count, 3).

    Their nominal coordinates are off by ``sigma_mm``, or by 1 mm when that is infinite.
    """
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3)) * VOLUME_MM
    off = sigma_mm if np.isfinite(sigma_mm) else 1.0
    nominal = points + off * rng.normal(size=points.shape)
    ids = tuple(f"ring{k + 1}" for k in range(count))
    return Carrier("stand", ids, nominal, np.full((count, 3), sigma_mm), fixed=True), points


def plate(
    columns: int = 8, rows: int = 6, spacing_mm: float = 20.0, sigma_mm: float = 0.02, seed: int = 4
) -> tuple[Carrier, Floats]:
    """A plate of corners, moved about by hand, and where its corners really are."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    nominal = spacing_mm * np.c_[x.ravel(), y.ravel(), np.zeros(x.size)]
    nominal -= nominal.mean(axis=0)
    ids = tuple(f"plate{k + 1}" for k in range(len(nominal)))
    points = nominal + sigma_mm * rng.normal(size=nominal.shape)
    return Carrier("plate", ids, nominal, np.full(nominal.shape, sigma_mm)), points


def bars(
    carrier: Carrier, points: Floats, count: int = 6, sigma_mm: float = 0.003, seed: int = 5
) -> tuple[Distance, ...]:
    """Measured distances between the farthest targets of a carrier, off by ``sigma_mm``."""
    rng = np.random.default_rng(seed)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    out: list[Distance] = []
    used: set[int] = set()
    for flat in np.argsort(-apart, axis=None):
        a, b = (int(v) for v in np.unravel_index(flat, apart.shape))
        if a < b and not {a, b} & used and len(out) < count:
            used |= {a, b}
            length = float(apart[a, b] + sigma_mm * rng.normal())
            out.append(Distance(carrier.ids[a], carrier.ids[b], length, sigma_mm))
    return tuple(out)


def plate_places(count: int, seed: int = 6) -> tuple[RigidTransform, ...]:
    """Places of a plate in the volume, facing the cameras and tilted to 40 degrees."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        tilt = rotation_of(np.radians(rng.uniform(-40.0, 40.0, 3)))
        # The plate's z away from the cameras: its printed side faces them.
        facing = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        shift = rng.uniform(-0.25, 0.25, 3) * VOLUME_MM
        out.append(RigidTransform(tilt @ facing, shift))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Scene:
    """A rig, targets with their true coordinates (m, 3), and where carriers stand.

    ``places`` has, for each carrier, its place in each frame; a fixed one has a single place.
    ``seen_otherwise`` maps (camera, frame) indices to a place in which that camera alone sees
    the moving carriers: what a late trigger does. ``widest_deg``: a moving carrier is seen when its
    front is turned from the camera by less than this; 180 for what can be seen from all sides.
    """

    cameras: tuple[CalibratedCamera, ...]
    targets: TargetSet
    true_mm: Floats
    places: tuple[tuple[RigidTransform, ...], ...]
    seen_otherwise: Mapping[tuple[int, int], RigidTransform] = field(default_factory=dict)
    widest_deg: float = 65.0

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return max(len(p) for p in self.places)

    def points(self, camera: int, carrier: int, frame: int) -> Floats:
        """Targets of a carrier in the rig frame (m, 3), as a camera meets them."""
        own = self.true_mm[self.targets.carrier_of == carrier]
        fixed = self.targets.carriers[carrier].fixed
        place = self.places[carrier][0 if fixed else frame]
        if not fixed:
            place = self.seen_otherwise.get((camera, frame), place)
        return np.asarray(own @ place.rotation.T + place.translation_mm)

    def observe(self, sigma_px: float, seed: int | np.random.Generator) -> Observations:
        """Image points of all targets that are in frame and face the camera."""
        index, pixels = self.exact()
        rng = np.random.default_rng(seed)
        noisy = pixels + sigma_px * rng.normal(size=pixels.shape)
        return self.observations(index, noisy, sigma_px)

    def observations(self, index: Ints, pixels: Floats, sigma_px: float) -> Observations:
        """Observations from rows (n, 3) of camera, frame, target, and their pixels (n, 2)."""
        return Observations(
            self.targets,
            tuple(c.name for c in self.cameras),
            np.array([c.image_size_px for c in self.cameras]),
            tuple(f"frame{k + 1}" for k in range(self.frame_count)),
            index[:, 0],
            index[:, 1],
            index[:, 2],
            pixels,
            np.full(pixels.shape, sigma_px),
        )

    def exact(self) -> tuple[Ints, Floats]:
        """Rows (n, 3) of camera, frame, target, and exact pixels (n, 2)."""
        rows, pixels = [], []
        first = np.cumsum([0, *(len(c.ids) for c in self.targets.carriers)])
        for c, camera in enumerate(self.cameras):
            for k in range(len(self.targets.carriers)):
                for frame in range(self.frame_count):
                    image = camera.project(self.points(c, k, frame))
                    good = _in_frame(image, camera) & self._facing(c, k, frame)
                    number = np.flatnonzero(good)
                    rows.append(
                        np.c_[
                            np.full(len(number), c), np.full(len(number), frame), first[k] + number
                        ]
                    )
                    pixels.append(image[good])
        return np.concatenate(rows).astype(np.int64), np.concatenate(pixels)

    def _facing(self, camera: int, carrier: int, frame: int) -> bool:
        """Whether a moving carrier turns its front to the camera; what stands is seen all round."""
        if self.targets.carriers[carrier].fixed:
            return True
        place = self.places[carrier][frame]
        away = place.translation_mm - self.cameras[camera].pose.position_rig_mm
        cosine = float(place.rotation[:, 2] @ away / np.linalg.norm(away))
        return cosine >= float(np.cos(np.radians(self.widest_deg)))

    def with_cameras(self, cameras: tuple[CalibratedCamera, ...]) -> Scene:
        """The same scene with other cameras."""
        return replace(self, cameras=cameras)


def _in_frame(image: Floats, camera: CalibratedCamera) -> Bools:
    width, height = camera.image_size_px
    x, y = image[:, 0], image[:, 1]
    with np.errstate(invalid="ignore"):
        return (x > 0.0) & (y > 0.0) & (x < width - 1.0) & (y < height - 1.0)


def face_scene(
    cameras: tuple[CalibratedCamera, ...] | None = None,
    rings: int = 60,
    frames: int = 12,
    seed: int = 1,
) -> Scene:
    """A stand of ring targets with six scale bars, and a plate shown in ``frames`` places."""
    rig = cameras or face_rig()
    still, still_points = stand(rings, seed)
    moving, moving_points = plate(seed=seed + 1)
    distances = bars(still, still_points, seed=seed + 2)
    targets = TargetSet("face", (still, moving), distances)
    nowhere = (RigidTransform(np.eye(3), np.zeros(3)),)
    places = (nowhere, plate_places(frames, seed + 3))
    return Scene(rig, targets, np.concatenate([still_points, moving_points]), places)


def turned(camera: CalibratedCamera, translation_mm: Floats, turn_rad: Floats) -> CalibratedCamera:
    """A camera moved by ``translation_mm`` along and turned by ``turn_rad`` about its own axes."""
    pose = camera.pose
    rotation = rotation_of(np.asarray(turn_rad, np.float64)) @ pose.rotation_rig_to_camera
    position = pose.position_rig_mm + np.asarray(translation_mm) @ pose.rotation_rig_to_camera
    return replace(camera, pose=Pose(position, rotation))
