"""The simulated studio: photographs its scene with the cameras of a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.errors import NotFoundError
from geometry.camera import RigCamera
from rig.acquisition.cameras.base import Image
from rig.acquisition.timingboard.graytime import lit_shares
from rig.simulation.defocus import defocused, softened
from rig.simulation.flats import Flat, FlatView, held_up, target, timing_board
from rig.simulation.imaging import sharp_image
from rig.simulation.lighting import card_light
from rig.simulation.mesh import TexturedMesh
from rig.simulation.motion import knocked, placement_at
from rig.simulation.previews import preview_camera
from rig.simulation.raytable import RayTables
from rig.simulation.sensor import developed
from rig.simulation.settings import SceneSettings, SensorSettings
from rig.simulation.tracing import BackdropView, HeadModel, SceneView

Singles = NDArray[np.float32]
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Shot:
    """One photograph to be taken.

    ``start_s`` is when the exposure starts, in seconds after the head is at rest in its place;
    ``board_start_us`` when, on the timing board's counter. ``seed`` makes the noise. A ``black``
    picture gets no light at all. ``capture`` counts captures: targets that are held up are
    elsewhere in each. ``moved_mm`` and ``turned_deg``: how far the camera is from its place, in
    its own axes. A ``preview`` is a picture of large pixels, quick to make.
    """

    camera: str
    exposure_us: float
    gain_db: float = 0.0
    f_number: float | None = None
    pixel_format: str = "RGB8"
    start_s: float = 0.0
    board_start_us: float = 0.0
    seed: tuple[int, ...] = (0,)
    black: bool = False
    capture: int = 0
    moved_mm: Triple = (0.0, 0.0, 0.0)
    turned_deg: Triple = (0.0, 0.0, 0.0)
    preview: bool = False


class Studio:
    """A scene and the cameras that photograph it. What does not change is worked out once.

    ``cameras`` as a design has them. Photographs with the same settings, shot and seed are the
    same to the last bit on one machine. Instances are used by one thread at a time.
    """

    def __init__(
        self,
        cameras: Sequence[RigCamera],
        scene: SceneSettings | None = None,
        sensor: SensorSettings | None = None,
    ) -> None:
        self.scene = scene or SceneSettings()
        self.sensor = sensor or SensorSettings()
        self.cameras: Mapping[str, RigCamera] = {camera.name: camera for camera in cameras}
        self._tables = RayTables()
        self._head: HeadModel | None = None
        self._targets: tuple[Flat, ...] | None = None

    @property
    def head(self) -> HeadModel | None:
        """The head, None for a scene without; read and made ready on first use."""
        if self._head is None and self.scene.with_head:
            self._head = HeadModel(self.scene)
        return self._head

    @property
    def surface(self) -> TexturedMesh | None:
        """The very surface that is photographed, at rest: what a reconstruction must find."""
        return None if self.head is None else self.head.mesh

    def photograph(self, shot: Shot) -> Image:
        """Take one photograph: (H, W) or (H, W, 3) RGB, 8 or 16 bits."""
        return self.developed(shot, self.light(shot))

    def developed(self, shot: Shot, light: Singles) -> Image:
        """The photograph that a shot's sensor makes of the light on it, (H, W, C)."""
        rig_camera = self._camera(shot)
        f_number = shot.f_number or rig_camera.camera.f_number
        reference = self.sensor.reference_f_number or rig_camera.camera.f_number
        stop = shot.exposure_us / self.sensor.reference_exposure_us * (reference / f_number) ** 2
        return developed(
            light,
            self._tables.of(rig_camera.camera),
            self.sensor,
            exposure=0.0 if shot.black else stop,
            gain=10.0 ** (shot.gain_db / 20.0),
            deep=shot.pixel_format.endswith("16"),
            rng=np.random.Generator(np.random.SFC64(np.random.SeedSequence(shot.seed))),
        )

    def light(self, shot: Shot) -> Singles:
        """The light on the sensor before it is counted, (H, W, C), with defocus and motion."""
        rig_camera = self._camera(shot)
        table = self._tables.of(rig_camera.camera)
        mono = shot.pixel_format.startswith("Mono")
        if shot.black:
            return np.zeros((*table.shape[:2], 1 if mono else 3), dtype=np.float32)
        samples = self.scene.motion.samples
        total: Singles | None = None
        for number in range(samples):
            middle_s = shot.start_s + 1e-6 * shot.exposure_us * (number + 0.5) / samples
            view = self._view(rig_camera, shot, middle_s)
            image = sharp_image(view, rig_camera, table, mono)
            light = image.radiance
            if self.sensor.depth_of_field:
                f_number = shot.f_number or rig_camera.camera.f_number
                light = defocused(image, view, table, rig_camera, f_number)
            total = light if total is None else total + light
        if total is None:
            raise AssertionError("an exposure has at least one sample")
        if samples > 1:
            total /= np.float32(samples)
        return softened(total, self.sensor.lens_blur_px)

    def _view(self, rig_camera: RigCamera, shot: Shot, middle_s: float) -> SceneView:
        placement = placement_at(self.scene.motion, middle_s)
        head = None if self.head is None else self.head.view(rig_camera, placement)
        pose = rig_camera.pose
        flats = [*self._shown(shot.capture), *self._board(shot)]
        views = [
            FlatView(
                flat, rig_camera, card_light(flat.facing_rig, self.scene.lights, self.scene.ambient)
            )
            for flat in flats
        ]
        backdrop = BackdropView(
            self.scene.backdrop, pose.position_rig_mm, pose.rotation_rig_to_camera
        )
        return SceneView(backdrop, head, tuple(views))

    def _shown(self, capture: int) -> tuple[Flat, ...]:
        """The targets where they are in a capture."""
        if self._targets is None:
            self._targets = tuple(target(settings) for settings in self.scene.targets)
        return tuple(
            flat if settings.held is None else held_up(flat, settings.held, capture)
            for flat, settings in zip(self._targets, self.scene.targets, strict=True)
        )

    def _board(self, shot: Shot) -> tuple[Flat, ...]:
        settings = self.scene.board
        if settings is None:
            return ()
        board = settings.board
        middle = (shot.board_start_us + 0.5 * shot.exposure_us) / board.tick_us
        length = shot.exposure_us / board.tick_us
        shares = lit_shares(np.array(middle % 2.0**board.bits), np.array(length), board.bits)
        return (timing_board(board, settings.place, shares, settings.level),)

    def _camera(self, shot: Shot) -> RigCamera:
        if shot.camera not in self.cameras:
            problem = f"there is no camera {shot.camera!r}"
            raise NotFoundError("camera", problem, "give a name of the rig")
        placed = knocked(self.cameras[shot.camera], shot.moved_mm, shot.turned_deg)
        return preview_camera(placed) if shot.preview else placed
