"""What stands in a catalogue file: its pydantic models.

``docs/reference/catalogue.md`` lists the keys, ``docs/reference/catalogue.schema.json`` is
generated from here.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from annotated_types import Len
from pydantic import ConfigDict, Field, model_validator

from common.files.strict import Pair, StrictModel, Vector

SCHEMA: Literal["rigwright.catalogue/1"] = "rigwright.catalogue/1"
SourceKind = Literal[
    "sheet", "review", "quoted", "standard", "derived", "measured", "typical", "user"
]
PartId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9\-]{0,39}$")]
Positive = Annotated[float, Field(gt=0.0, le=1e9)]
Words = Annotated[str, Field(min_length=1, max_length=300)]
NOT_FIGURES = frozenset({"name", "maker", "kind", "note", "source"})


class SourceEntry(StrictModel):
    """Where figures come from."""

    title: Words = Field(description="Name of the data sheet, standard or review.")
    kind: SourceKind = Field(
        description="`sheet`: read in the maker's document. `review`: read in somebody else's. "
        "`quoted`: the maker's figure as commonly quoted. `standard`. `derived`: computed from "
        "other figures. `measured`. `typical`: of a class of products. `user`."
    )
    figures: list[str] = Field(
        default_factory=list,
        description="Keys it is the source of. Without it: all that no other source names.",
    )


class Entry(StrictModel):
    """What every entry has."""

    name: Words = Field(description="What to call it.")
    maker: Words = Field(description="Who makes it; `any` for what many make.")
    note: Words | None = Field(default=None, description="What else to know.")
    source: list[SourceEntry] = Field(default_factory=list, description="Sources of the figures.")

    def figures(self) -> list[str]:
        """Keys that state a figure and were given."""
        return [
            key for key in type(self).model_fields if key not in NOT_FIGURES and self._given(key)
        ]

    def _given(self, key: str) -> bool:
        value = getattr(self, key)
        return value is not None and value != []

    @model_validator(mode="after")
    def _every_figure_has_a_source(self) -> Self:
        given, named = self.figures(), {key for s in self.source for key in s.figures}
        unknown = sorted(named - set(given))
        if unknown:
            raise ValueError(f"a source names {unknown[0]}, which is not given")
        if not any(not source.figures for source in self.source):
            without = [key for key in given if key not in named]
            if without:
                raise ValueError(f"{without[0]} has no source: add a [[...source]] table")
        return self


class CameraEntry(Entry):
    """A camera body."""

    kind: Literal["machine-vision", "dslr", "mirrorless", "board", "action"] = Field(
        description="Kind of camera."
    )
    mount: Words = Field(description="Its lens mount, or `fixed`.")
    fixed_lens: PartId | None = Field(default=None, description="The lens of a `fixed` mount.")
    shutter: Literal["global", "rolling", "rolling-global-reset", "focal-plane"] = Field(
        description="How the exposure is timed over the image."
    )
    image_size_px: Annotated[list[Annotated[int, Field(ge=2, le=100_000)]], Len(2, 2)] = Field(
        description="Width and height of its largest image."
    )
    pixel_pitch_um: Positive | None = Field(
        default=None, description="Distance of neighbouring pixels."
    )
    sensor_size_mm: Pair | None = Field(
        default=None, description="Width and height of the sensor, where no pitch is published."
    )
    body_size_mm: Vector | None = Field(
        default=None, description="Width, height and depth without the lens."
    )
    flange_stand_mm: Annotated[float, Field(ge=0.0)] | None = Field(
        default=None, description="How far the flange stands out of the body's front."
    )
    mass_g: Positive | None = Field(default=None, description="Mass without the lens.")
    tripod_thread: Words | None = Field(default=None, description="Its tripod thread.")
    thread_mm: Vector | None = Field(
        default=None,
        description="Mouth of the thread from where the optical axis meets the flange, in camera "
        "axes.",
    )
    trigger: Literal["opto", "logic", "contact", "software"] | None = Field(
        default=None,
        description="Trigger input: an optocoupler, a logic level, a remote release's contact, or "
        "none but software.",
    )
    trigger_connector: Words | None = Field(
        default=None, description="Connector of a remote release."
    )
    trigger_delay_us: Annotated[float, Field(ge=0.0)] | None = Field(
        default=None, description="Published delay from the trigger to the exposure."
    )
    interface: Words | None = Field(default=None, description="How images leave it.")


class LensEntry(Entry):
    """A lens of fixed focal length."""

    kind: Literal["machine-vision", "photographic", "built-in"] = Field(description="Kind of lens.")
    mount: Words = Field(description="The mount it is made for, or `fixed`.")
    focal_length_mm: Positive = Field(description="Nominal focal length.")
    f_number_min: Positive | None = Field(default=None, description="Widest aperture.")
    f_number_max: Positive | None = Field(default=None, description="Narrowest aperture.")
    min_focus_mm: Positive | None = Field(default=None, description="Nearest focus.")
    min_focus_from: Literal["sensor", "front"] | None = Field(
        default=None, description="Where the nearest focus counts from."
    )
    image_circle_mm: Positive | None = Field(default=None, description="Diameter it covers.")
    diameter_mm: Positive | None = Field(default=None, description="Greatest diameter.")
    length_mm: Positive | None = Field(
        default=None, description="From the flange to the front, focused at infinity."
    )
    entrance_pupil_mm: float | None = Field(
        default=None, description="From the flange forward to the entrance pupil."
    )
    mass_g: Positive | None = Field(default=None, description="Mass.")

    @model_validator(mode="after")
    def _focus_and_aperture(self) -> Self:
        if (self.min_focus_mm is None) != (self.min_focus_from is None):
            raise ValueError("give min_focus_mm and min_focus_from together")
        low, high = self.f_number_min, self.f_number_max
        if low is not None and high is not None and low > high:
            raise ValueError("f_number_min is above f_number_max")
        return self


class AdapterEntry(StrictModel):
    """What joins a lens of another mount to this one."""

    lens: Words = Field(description="Mount of the lens.")
    name: str = Field(default="", description="The adapter; empty: none is needed.")


class MountEntry(Entry):
    """A lens mount."""

    kind: Literal["lens-mount"] = Field(default="lens-mount", description="Kind of part.")
    maker: Words = Field(default="any", description="Who makes it.")
    flange_mm: Positive | None = Field(default=None, description="From the flange to the sensor.")
    thread: Words | None = Field(default=None, description="Its thread, if it is screwed.")
    adapters: list[AdapterEntry] = Field(
        default_factory=list, description="Other lenses it takes, and by what."
    )


class HeadEntry(Entry):
    """A tripod head."""

    kind: Literal["ball", "geared", "pan-tilt"] = Field(description="Kind of head.")
    pan_deg: Pair | None = Field(default=None, description="Range of pan, right positive.")
    tilt_deg: Pair | None = Field(default=None, description="Range of tilt, up positive.")
    roll_deg: Pair | None = Field(default=None, description="Range of roll, clockwise positive.")
    step_deg: Positive | None = Field(default=None, description="What it can be set to.")
    load_kg: Positive | None = Field(default=None, description="What it carries.")
    height_mm: Positive | None = Field(default=None, description="Base to camera.")
    pivot_mm: Positive | None = Field(
        default=None, description="Base to where its axes cross; of a ball, to its middle."
    )
    width_mm: Positive | None = Field(default=None, description="Greatest width.")
    mass_g: Positive | None = Field(default=None, description="Mass.")
    base_thread: Words | None = Field(default=None, description="Thread it stands on.")
    camera_thread: Words | None = Field(default=None, description="Thread for the camera.")


class ProfileEntry(Entry):
    """A T-slot profile."""

    kind: Literal["t-slot"] = Field(default="t-slot", description="Kind of profile.")
    series: Words = Field(description="Series, such as `2020`.")
    width_mm: Positive = Field(description="Width of the section.")
    height_mm: Positive = Field(description="Height of the section.")
    slot_width_mm: Positive | None = Field(default=None, description="Opening of a slot.")
    slot_spacing_mm: Positive | None = Field(default=None, description="Distance of its slots.")
    bolt: Words | None = Field(default=None, description="Bolt that fits its slot.")
    core_bore_mm: Positive | None = Field(default=None, description="Bore of its core.")
    mass_kg_per_m: Positive | None = Field(default=None, description="Mass per metre.")
    inertia_x_mm4: Positive | None = Field(
        default=None, description="Second moment of area about the axis along its width."
    )
    inertia_y_mm4: Positive | None = Field(
        default=None, description="The same about the axis along its height."
    )
    torsion_mm4: Positive | None = Field(
        default=None,
        description="Its torsion constant; where it is not known, a fifth of the smaller inertia.",
    )
    elasticity_n_per_mm2: Positive | None = Field(default=None, description="Young's modulus.")


class BracketEntry(Entry):
    """A bracket or joint."""

    kind: Literal[
        "corner", "pivot", "head-plate", "clamp", "stand", "end-cap", "strip", "levelling-foot"
    ] = Field(
        description="Kind of bracket; a stand carries a head over the floor, an end cap closes a "
        "profile, a strip joins two where they meet at an angle, a frame stands on levelling feet."
    )
    series: list[Words] = Field(description="Profile series it fits.")
    size_mm: Vector | None = Field(
        default=None, description="Width, height and depth; of a stand at its full height."
    )
    leg_mm: Positive | None = Field(
        default=None, description="Thickness of what its screws go through; 4 where not known."
    )
    bolt: Words | None = Field(default=None, description="Bolts it takes.")
    bolts: Annotated[int, Field(ge=1, le=100)] | None = Field(default=None, description="How many.")
    angle_deg: Pair | None = Field(default=None, description="Range of its angle.")
    step_deg: Positive | None = Field(default=None, description="What it can be set to.")
    thread: Words | None = Field(
        default=None,
        description="Thread of the stud for a head, of a head plate or a stand; of a levelling "
        "foot that of its own stud.",
    )
    height_mm: Pair | None = Field(
        default=None, description="Of a levelling foot: least and greatest height it is turned to."
    )
    load_kg: Positive | None = Field(default=None, description="What a levelling foot carries.")
    mass_g: Positive | None = Field(default=None, description="Mass.")


class FastenerEntry(Entry):
    """A screw, nut or stud, or an adapter from one thread to another."""

    kind: Literal["cap-screw", "hex-nut", "stud", "t-nut", "adapter"] = Field(
        description="Kind of fastener."
    )
    thread: Words = Field(description="Thread; of an adapter the one that goes into a hole.")
    inner_thread: Words | None = Field(
        default=None, description="Of an adapter: thread of the stud that goes into it."
    )
    diameter_mm: Positive | None = Field(default=None, description="Nominal diameter.")
    pitch_mm: Positive | None = Field(default=None, description="Pitch of the thread.")
    head_diameter_mm: Positive | None = Field(default=None, description="Diameter of the head.")
    head_height_mm: Positive | None = Field(
        default=None, description="Height of head or nut; of an adapter what it adds."
    )
    across_flats_mm: Positive | None = Field(default=None, description="Width across flats.")
    key_mm: Positive | None = Field(default=None, description="Hexagon key.")
    series: Words | None = Field(default=None, description="Profile series it fits.")
    mass_g: Positive | None = Field(default=None, description="Mass.")


class CatalogueFile(StrictModel):
    """The root of a catalogue file. Between a kind and a key stands the entry's id."""

    model_config = ConfigDict(title="Rigwright catalogue file")

    schema_: Literal["rigwright.catalogue/1"] = Field(
        alias="schema", description='Version of the format: `"rigwright.catalogue/1"`.'
    )
    camera: dict[PartId, CameraEntry] = Field(default_factory=dict, description="Cameras.")
    lens: dict[PartId, LensEntry] = Field(default_factory=dict, description="Lenses.")
    mount: dict[PartId, MountEntry] = Field(default_factory=dict, description="Lens mounts.")
    head: dict[PartId, HeadEntry] = Field(default_factory=dict, description="Tripod heads.")
    profile: dict[PartId, ProfileEntry] = Field(default_factory=dict, description="Profiles.")
    bracket: dict[PartId, BracketEntry] = Field(default_factory=dict, description="Brackets.")
    fastener: dict[PartId, FastenerEntry] = Field(default_factory=dict, description="Fasteners.")


ENTRIES: dict[str, type[Entry]] = {
    "camera": CameraEntry,
    "lens": LensEntry,
    "mount": MountEntry,
    "head": HeadEntry,
    "profile": ProfileEntry,
    "bracket": BracketEntry,
    "fastener": FastenerEntry,
}
