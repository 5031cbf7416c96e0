"""What can be chosen about the simulated studio: plain numbers, words and paths, all with defaults.

Every object checks itself and raises :class:`~common.errors.InputError`. Radiances are shares
of what fills the sensor's wells at the reference exposure and aperture; a white card that faces
the key light has about 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rig.simulation.checks import require, require_range
from rig.simulation.faults import CameraFaults
from rig.simulation.flatsettings import BoardSettings, TargetSettings

Triple = tuple[float, float, float]
Quad = tuple[float, float, float, float]

PIXEL_FORMATS = ("Mono8", "Mono16", "RGB8", "RGB16")
"""8 bits are coded with the sRGB curve, 16 bits are linear."""


@dataclass(frozen=True)
class LightSettings:
    """A soft box: ``position_rig_mm`` of its middle, ``size_mm`` across, ``power``, colour RGB.

    ``power`` is the radiance that a white card facing the light has by it alone. The light comes
    from one direction for the whole head; its size softens the edges of shadows.
    """

    position_rig_mm: Triple
    power: float
    size_mm: float = 600.0
    colour: Triple = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        require_range("light_power", self.power, 0.0, 1e3)
        require_range("light_size_mm", self.size_mm, 0.0, 1e5)
        require_range("light_distance_mm", math.hypot(*self.position_rig_mm), 1.0, 1e7)
        for part in self.colour:
            require_range("light_colour", part, 0.0, 10.0)


DEFAULT_LIGHTS = (
    LightSettings((-1100.0, -1300.0, 900.0), 0.78, 700.0, (1.0, 0.97, 0.93)),
    LightSettings((1300.0, -1200.0, 250.0), 0.40, 900.0, (0.95, 0.98, 1.0)),
    LightSettings((500.0, 1100.0, 800.0), 0.45, 500.0, (1.0, 1.0, 1.0)),
)
"""Key light high on the subject's right, fill on the left, a rim light from behind."""


@dataclass(frozen=True)
class HeadSettings:
    """Whose head. Without ``scan`` it is the bundled synthetic head with procedural skin.

    ``scan`` is a GLB, glTF or OBJ with texture coordinates; ``texture`` its colour picture where
    the file holds none; ``displacement`` a grey picture on the same coordinates, of which what is
    finer than ``detail_width_px`` shows as light and dark, rms ``detail_contrast``. ``units``,
    ``up`` and ``front`` as for every scan. ``flip_texture`` turns separate pictures upside down,
    as heads of some web viewers have them. ``subdivisions`` halve the edges of the mesh and round
    it (Loop). ``grain_contrast`` is the rms of the grain, 0 for none; ``sheen`` the strength of
    the skin's gloss.
    """

    scan: Path | None = None
    texture: Path | None = None
    displacement: Path | None = None
    flip_texture: bool = False
    units: str = "auto"
    up: str = "auto"
    front: str = "auto"
    subdivisions: int = 1
    grain_contrast: float = 0.06
    detail_contrast: float = 0.08
    detail_width_px: float = 16.0
    sheen: float = 0.05
    seed: int = 0

    def __post_init__(self) -> None:
        require_range("subdivisions", self.subdivisions, 0, 3)
        require_range("grain_contrast", self.grain_contrast, 0.0, 0.5)
        require_range("detail_contrast", self.detail_contrast, 0.0, 2.0)
        require_range("detail_width_px", self.detail_width_px, 1.0, 500.0)
        require_range("sheen", self.sheen, 0.0, 1.0)
        require_range("seed", self.seed, 0, 2**63)


@dataclass(frozen=True)
class MotionSettings:
    """How the head moves, rigidly: it is at rest in its place at the first edge of each capture.

    It turns about the rig's origin by ``angular_velocity_deg_s`` (an axis times a rate).
    ``samples`` instants of each exposure are averaged; 1 freezes the middle.
    """

    velocity_mm_s: Triple = (0.0, 0.0, 0.0)
    angular_velocity_deg_s: Triple = (0.0, 0.0, 0.0)
    samples: int = 1

    def __post_init__(self) -> None:
        for value in self.velocity_mm_s:
            require_range("velocity_mm_s", value, -1e5, 1e5)
        for value in self.angular_velocity_deg_s:
            require_range("angular_velocity_deg_s", value, -1e5, 1e5)
        require_range("motion_samples", self.samples, 1, 64)


@dataclass(frozen=True)
class BackdropSettings:
    """A wall behind the head, with a glow of ``radius_mm`` that is brightest in the middle.

    ``distance_mm`` along the rig's Y; ``centre`` and ``edge`` are radiances, RGB.
    """

    distance_mm: float = 1400.0
    centre: Triple = (0.22, 0.23, 0.25)
    edge: Triple = (0.05, 0.052, 0.058)
    radius_mm: float = 900.0

    def __post_init__(self) -> None:
        require_range("backdrop_distance_mm", self.distance_mm, 200.0, 1e6)
        require_range("backdrop_radius_mm", self.radius_mm, 1.0, 1e6)
        for value in (*self.centre, *self.edge):
            require_range("backdrop_radiance", value, 0.0, 1e3)


@dataclass(frozen=True)
class SceneSettings:
    """All that stands before the cameras. ``ambient`` is the light that comes from everywhere."""

    head: HeadSettings = field(default_factory=HeadSettings)
    with_head: bool = True
    motion: MotionSettings = field(default_factory=MotionSettings)
    lights: tuple[LightSettings, ...] = DEFAULT_LIGHTS
    ambient: float = 0.22
    backdrop: BackdropSettings = field(default_factory=BackdropSettings)
    targets: tuple[TargetSettings, ...] = ()
    board: BoardSettings | None = None

    def __post_init__(self) -> None:
        require_range("ambient", self.ambient, 0.0, 1e3)


@dataclass(frozen=True)
class SensorSettings:
    """The sensor of every simulated camera.

    The wells (``full_well_e`` electrons) are full at radiance 1, ``reference_exposure_us`` and
    ``reference_f_number``, at gain 0 dB; ``read_noise_e`` is rms. ``vignetting`` 1 is the natural
    fall of light (cos^4), 0 none. ``depth_of_field`` False makes everything sharp but for
    ``lens_blur_px``, the standard deviation of what lens and diffraction blur even in focus.
    """

    full_well_e: float = 10_000.0
    read_noise_e: float = 6.0
    reference_exposure_us: float = 4000.0
    reference_f_number: float | None = None
    vignetting: float = 1.0
    depth_of_field: bool = True
    lens_blur_px: float = 0.5

    def __post_init__(self) -> None:
        require_range("full_well_e", self.full_well_e, 100.0, 1e7)
        require_range("read_noise_e", self.read_noise_e, 0.0, 1e4)
        require_range("reference_exposure_us", self.reference_exposure_us, 1.0, 1e8)
        require_range("lens_blur_px", self.lens_blur_px, 0.0, 20.0)
        require_range("vignetting", self.vignetting, 0.0, 4.0)
        if self.reference_f_number is not None:
            require_range("reference_f_number", self.reference_f_number, 0.5, 128.0)


@dataclass(frozen=True)
class SimulationSettings:
    """Simulated cameras: what they see, how they are built, how they misbehave.

    ``outputs`` by camera name says which output of the trigger box each is wired to; without it
    the cameras take outputs 1, 2, 3... in the order of the design. ``workers`` processes render,
    0 renders in a thread of this process, None takes one for each core. ``trigger`` is ``edge``
    or ``software``. ``readout_ms`` passes from the end of an exposure to the frame's arrival.
    ``faults`` by camera name; ``"*"`` is for all that are not named. The cameras' clocks begin at
    random and run at random up to ``clock_drift_ppm`` fast or slow; their frame counters stand at
    ``counter_start`` and begin again after ``counter_modulus`` values. ``render_limit_s`` gives a
    picture up that is not rendered by then; None never does, because a simulated camera is not
    late for the computer's being busy.
    """

    scene: SceneSettings = field(default_factory=SceneSettings)
    sensor: SensorSettings = field(default_factory=SensorSettings)
    exposure_us: float = 4000.0
    gain_db: float = 0.0
    pixel_format: str = "RGB8"
    trigger: str = "edge"
    outputs: Mapping[str, int] = field(default_factory=dict)
    faults: Mapping[str, CameraFaults] = field(default_factory=dict)
    workers: int | None = None
    readout_ms: float = 30.0
    clock_drift_ppm: float = 20.0
    counter_modulus: int = 65536
    counter_start: int = 0
    seed: int = 0
    render_limit_s: float | None = None

    def __post_init__(self) -> None:
        require_range("exposure_us", self.exposure_us, 1.0, 1e7)
        require_range("gain_db", self.gain_db, 0.0, 48.0)
        require_range("readout_ms", self.readout_ms, 0.0, 1e5)
        require_range("clock_drift_ppm", self.clock_drift_ppm, 0.0, 1e4)
        require_range("counter_modulus", self.counter_modulus, 2, 2**63)
        require_range("counter_start", self.counter_start, 0, self.counter_modulus - 1)
        require_range("seed", self.seed, 0, 2**63)
        if self.render_limit_s is not None:
            require_range("render_limit_s", self.render_limit_s, 1.0, 1e5)
        require_range("workers", self.workers or 0, 0, 1024)
        for name, value, known in (
            ("pixel_format", self.pixel_format, PIXEL_FORMATS),
            ("trigger", self.trigger, ("edge", "software")),
        ):
            require(
                value in known,
                name.replace("_", "-"),
                f"{name} of the simulation is {value!r}",
                f"give {', '.join(known)}",
            )
        require(
            all(output >= 1 for output in self.outputs.values()),
            "outputs",
            "outputs of the trigger box are counted from 1",
            "give 1 or more",
        )

    def faults_of(self, camera: str) -> CameraFaults:
        """How a camera misbehaves."""
        return self.faults.get(camera, self.faults.get("*", CameraFaults()))
