"""The sections of a station file: one pydantic model each, and what each turns into."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from annotated_types import Len
from pydantic import Field, field_validator, model_validator

from common.files.strict import CameraName, StrictModel
from rig.acquisition.cameras.base import CameraSettings
from rig.acquisition.cameras.wholeness import MEDIA_TYPES
from rig.acquisition.station.spec import (
    BoardPlan,
    CameraPlan,
    CapturePolicy,
    ImageFormat,
    Interlock,
    LightPlan,
    TriggerPlan,
)

Output = Annotated[int, Field(ge=1, le=64)]
Microseconds = Annotated[float, Field(ge=0.0, le=1e9)]
USUAL_LEAD_US = 2000.0
LONGEST_FOCUS_LEAD_US = 1_500_000.0
"""An order to a box returns within two seconds."""


class TriggerSection(StrictModel):
    """The ``[trigger]`` section."""

    backend: Literal["rigwright", "esper"] = Field(
        default="rigwright",
        description="What the box speaks: Rigwright's own protocol, or that of the ESPER "
        "TriggerBox.",
    )
    url: str = Field(
        min_length=1,
        max_length=500,
        description="Serial port or pySerial URL; a path under `/dev/serial/by-id` stays the same "
        "when the box is plugged in elsewhere. `fake:` is a box that exists only in the program.",
    )
    serial_number: str | None = Field(
        default=None,
        min_length=1,
        max_length=64,
        description="Serial number the box must have. Another box is refused.",
    )
    lead_us: Microseconds | None = Field(
        default=None,
        description="From FIRE to the start of the first shot. Without it: 2000, and 0 for an "
        "ESPER box, which can hold none.",
    )
    interlock: Literal["required", "if-present"] = Field(
        default="if-present",
        description="`required`: no capture unless the box says that its interlock is closed. "
        "`if-present`: only an open one stops a capture.",
    )

    half_press: bool = Field(
        default=False,
        description="Of an ESPER box: whether it holds the focus lines from arming until the "
        "capture is over, as most bodies need for a steady lag.",
    )
    focus_lead_us: float = Field(
        default=0.0,
        ge=0.0,
        le=LONGEST_FOCUS_LEAD_US,
        description="With `half_press`: how long the focus lines are held before the box fires, "
        "at least.",
    )

    @model_validator(mode="after")
    def _focus_that_can_be(self) -> Self:
        if self.half_press and self.backend != "esper":
            raise ValueError("half_press is of an ESPER box; give each camera a focus_output")
        if self.focus_lead_us and not self.half_press:
            raise ValueError("focus_lead_us needs half_press = true")
        return self

    @model_validator(mode="after")
    def _lead_that_can_be(self) -> Self:
        if self.backend == "esper" and self.lead_us:
            raise ValueError("an ESPER box starts with FIRE; leave lead_us away")
        return self

    def to_plan(self) -> TriggerPlan:
        """The box as the rest of the program sees it."""
        usual = 0.0 if self.backend == "esper" else USUAL_LEAD_US
        lead = usual if self.lead_us is None else self.lead_us
        return TriggerPlan(
            self.backend,
            self.url,
            self.serial_number,
            lead,
            Interlock(self.interlock),
            self.half_press,
            self.focus_lead_us,
        )


class SettingsSection(StrictModel):
    """The ``[camera.settings]`` section: what is asked of a camera before a capture."""

    exposure_us: float | None = Field(default=None, gt=0.0, description="Exposure time.")
    gain_db: float | None = Field(default=None, description="Gain.")
    iso: int | None = Field(default=None, ge=1, description="ISO speed.")
    f_number: float | None = Field(default=None, gt=0.0, description="Aperture: 16 for f/16.")
    pixel_format: str | None = Field(
        default=None, min_length=1, description="Pixel format, in the camera's own words."
    )

    def to_settings(self) -> CameraSettings:
        """The settings as a camera takes them."""
        return CameraSettings(**self.model_dump())


class StationCameraSection(StrictModel):
    """A ``[[camera]]`` section: one camera of the station."""

    name: CameraName = Field(
        description="Name of the camera: its folder in a session, and its camera in the design."
    )
    backend: str = Field(
        pattern=r"^[a-z][a-z0-9_-]{0,30}$",
        description="How it is reached: `simulated`, `folder`, `opencv`, `genicam`, `aravis`, "
        "`gphoto2`.",
    )
    id: str = Field(
        min_length=1,
        max_length=200,
        description="Its serial number, or what `rigwright cameras` lists for it.",
    )
    output: Output | None = Field(
        default=None,
        description="Output of the box that fires it. Without it: none. Cameras with equal "
        "`delay_us` and `width_us` may share one.",
    )
    focus_output: Output | None = Field(
        default=None,
        description="Output that half-presses its release. Cameras with equal `focus_lead_us`, "
        "`delay_us` and `width_us` may share one.",
    )
    focus_lead_us: Microseconds = Field(
        default=0.0, description="How long before the shutter the focus line goes high."
    )
    delay_us: Microseconds = Field(
        default=0.0,
        description="From the shot's zero to the edge that fires it. `rigwright rig check --write` "
        "finds it.",
    )
    width_us: float = Field(default=1000.0, gt=0.0, le=1e9, description="Width of its pulse.")
    settings: SettingsSection = Field(
        default_factory=SettingsSection,
        description="What to set before a capture. What is left out stays as it is.",
    )
    expected_lag_us: Microseconds = Field(
        default=0.0, description="From the edge to the start of the exposure, as far as is known."
    )
    lag_tolerance_us: float = Field(
        default=20_000.0,
        gt=0.0,
        le=1e9,
        description="How far the true lag may be from it. A picture that is farther off is not "
        "taken for this shot's.",
    )
    image_size_px: Annotated[list[Annotated[int, Field(ge=2)]], Len(2, 2)] | None = Field(
        default=None,
        description="Width and height its pictures must have. Without it: as in the design.",
    )

    files: list[str] = Field(
        default_factory=list,
        max_length=4,
        description='Kinds of files that each shot must bring, such as `[".jpg", ".nef"]`: a shot '
        "is waited for until all are there, and what is lacking is told. Without it: one picture, "
        "and for folder cameras those kinds that the newest exposure in the folder has.",
    )

    @field_validator("files")
    @classmethod
    def _known_kinds(cls, files: list[str]) -> list[str]:
        strange = [suffix for suffix in files if suffix.lower() not in MEDIA_TYPES]
        if strange:
            raise ValueError(f"{strange[0]} is no kind of picture; known: {', '.join(MEDIA_TYPES)}")
        return files

    def to_plan(self) -> CameraPlan:
        """The camera as the rest of the program sees it."""
        size = self.image_size_px
        return CameraPlan(
            name=self.name,
            backend=self.backend,
            id=self.id,
            output=self.output,
            focus_output=self.focus_output,
            focus_lead_us=self.focus_lead_us,
            delay_us=self.delay_us,
            width_us=self.width_us,
            settings=self.settings.to_settings(),
            expected_lag_us=self.expected_lag_us,
            lag_tolerance_us=self.lag_tolerance_us,
            image_size_px=None if size is None else (size[0], size[1]),
            kinds=frozenset(MEDIA_TYPES[suffix.lower()] for suffix in self.files),
        )


class StrobeSection(StrictModel):
    """A ``[[strobe]]`` section: one flash."""

    output: Output = Field(description="Output of the box that fires it.")
    delay_us: Microseconds = Field(default=0.0, description="From the shot's zero to its edge.")
    width_us: float = Field(default=500.0, gt=0.0, le=1e9, description="Width of its pulse.")

    def to_plan(self) -> LightPlan:
        """The flash as the rest of the program sees it."""
        return LightPlan(self.output, self.delay_us, self.width_us)


class BoardSection(StrictModel):
    """The ``[led.board]`` section: the LED timing board itself."""

    bits: int = Field(default=16, ge=4, le=32, description="LEDs in a row: bits of its counter.")
    tick_us: float = Field(default=100.0, gt=0.0, description="Time of one count.")
    pitch_mm: float = Field(default=7.0, gt=0.0, description="From LED to LED in a row.")
    row_gap_mm: float = Field(default=10.0, gt=0.0, description="From row to row.")
    led_diameter_mm: float = Field(default=3.0, gt=0.0, description="Diameter of an LED.")
    marker_mm: float = Field(default=20.0, gt=0.0, description="Side of a corner marker.")
    dictionary: str = Field(
        default="DICT_4X4_50", description="OpenCV's name of the markers' dictionary."
    )
    marker_ids: Annotated[list[Annotated[int, Field(ge=0)]], Len(4, 4)] = Field(
        default_factory=lambda: [40, 41, 42, 43],
        description="Markers at top left, top right, bottom right, bottom left.",
    )

    def to_plan(self) -> BoardPlan:
        """The board as the rest of the program sees it."""
        a, b, c, d = self.marker_ids
        values = self.model_dump(exclude={"marker_ids"})
        return BoardPlan(**values, marker_ids=(a, b, c, d))


class LedSection(StrictModel):
    """The ``[led]`` section: the lines that drive an LED timing board."""

    outputs: Annotated[list[Output], Len(1, 16)] = Field(
        description="Outputs of the box that start the board."
    )
    delay_us: Microseconds = Field(default=0.0, description="From the shot's zero to their edge.")
    width_us: float = Field(default=1000.0, gt=0.0, le=1e9, description="Width of their pulse.")

    board: BoardSection | None = Field(
        default=None,
        description="The board, where one stands in the pictures: captures then read it.",
    )

    def to_board(self) -> BoardPlan | None:
        """The board, None where none is described."""
        return None if self.board is None else self.board.to_plan()

    def to_plans(self) -> tuple[LightPlan, ...]:
        """The lines as the rest of the program sees them."""
        return tuple(LightPlan(output, self.delay_us, self.width_us) for output in self.outputs)


class CaptureSection(StrictModel):
    """The ``[capture]`` section: how captures are taken."""

    ready_deadline_s: float = Field(
        default=5.0, gt=0.0, le=600.0, description="How long the cameras may take to get ready."
    )
    frame_deadline_s: float = Field(
        default=2.0,
        gt=0.0,
        le=3600.0,
        description="How long after its shot a picture may take to arrive.",
    )
    settle_s: float = Field(
        default=0.1,
        ge=0.0,
        le=60.0,
        description="How long to wait for pictures nobody asked for, once all wanted are there: a "
        "camera that runs freely is known by them.",
    )
    allow_partial: bool = Field(
        default=False,
        description="Whether a capture may go on without a camera that is not ready.",
    )
    min_free_mb: float = Field(
        default=1000.0, ge=0.0, description="Free space below which no capture is begun."
    )
    skew_limit_us: float = Field(
        default=1000.0,
        gt=0.0,
        description="Largest difference of the exposures' middles that passes as one instant.",
    )
    image_format: Literal["jpeg", "png", "tiff"] = Field(
        default="jpeg",
        description="How pictures are filed that come as pixels. Pictures of 16 bits become PNG "
        "where a JPEG cannot hold them. Files made by a camera stay as they are.",
    )
    jpeg_quality: int = Field(default=95, ge=50, le=100, description="Quality of JPEG files.")

    def to_policy(self) -> CapturePolicy:
        """The policy as the rest of the program sees it."""
        values = self.model_dump()
        return CapturePolicy(**{**values, "image_format": ImageFormat(self.image_format)})
