"""The parts a rig is built from, as the program sees them: frozen, in millimetres and degrees.

A figure that nobody published is None; nothing here is guessed. Where each figure comes from
stands in ``sources``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

PairOf = tuple[float, float]
SizeOf = tuple[float, float, float]
MICROMETRES = 1000.0
FIXED = "fixed"
"""The mount of a camera whose lens cannot be changed, and of such a lens."""


@dataclass(frozen=True)
class Source:
    """Where figures come from.

    ``kind``: ``sheet`` (read in the maker's own document), ``review`` (read in somebody else's),
    ``quoted`` (the maker's figure as commonly quoted, the document not at hand), ``standard``,
    ``derived`` (computed from other figures), ``measured``, ``typical`` (of a class of products)
    or ``user``.
    """

    title: str
    kind: str


@dataclass(frozen=True, kw_only=True)
class Part:
    """What every entry has. ``sources`` names the source of each of its figures."""

    id: str
    name: str
    maker: str
    kind: str
    sources: Mapping[str, Source]
    note: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))


@dataclass(frozen=True, kw_only=True)
class CatalogueCamera(Part):
    """A camera body. ``body_size_mm`` is width, height, depth without the lens.

    ``thread_mm`` is the tripod thread's mouth from where the optical axis meets the flange, in
    camera axes (x right, y down, z forward). ``flange_stand_mm``: how far the flange stands
    out of the body's front.
    """

    mount: str
    shutter: str
    image_size_px: tuple[int, int]
    pixel_pitch_um: float | None = None
    sensor_size_mm: PairOf | None = None
    body_size_mm: SizeOf | None = None
    flange_stand_mm: float | None = None
    mass_g: float | None = None
    tripod_thread: str | None = None
    thread_mm: SizeOf | None = None
    trigger: str | None = None
    trigger_connector: str | None = None
    trigger_delay_us: float | None = None
    interface: str | None = None
    fixed_lens: str | None = None

    @property
    def pitch_um(self) -> float | None:
        """Pixel pitch, from the sensor's width where it is not published."""
        if self.pixel_pitch_um is not None or self.sensor_size_mm is None:
            return self.pixel_pitch_um
        return float(f"{self.sensor_size_mm[0] / self.image_size_px[0] * MICROMETRES:.4g}")

    @property
    def active_size_mm(self) -> PairOf | None:
        """Width and height of the pixels used, None when the pitch is not known."""
        pitch = self.pitch_um
        if pitch is None:
            return None
        width, height = self.image_size_px
        return width * pitch / MICROMETRES, height * pitch / MICROMETRES

    @property
    def diagonal_mm(self) -> float | None:
        """Diagonal of the pixels used."""
        size = self.active_size_mm
        return None if size is None else float(np.hypot(*size))


@dataclass(frozen=True, kw_only=True)
class CatalogueLens(Part):
    """A lens of fixed focal length.

    ``min_focus_mm`` counts from the sensor or the front of the lens (``min_focus_from``),
    ``length_mm`` from its flange to its front, ``entrance_pupil_mm`` from its flange forward.
    ``image_circle_mm`` is the diameter it covers.
    """

    mount: str
    focal_length_mm: float
    f_number_min: float | None = None
    f_number_max: float | None = None
    min_focus_mm: float | None = None
    min_focus_from: str | None = None
    image_circle_mm: float | None = None
    diameter_mm: float | None = None
    length_mm: float | None = None
    entrance_pupil_mm: float | None = None
    mass_g: float | None = None


@dataclass(frozen=True, kw_only=True)
class Adapter:
    """What joins a lens of mount ``lens`` to a body; an empty name: nothing is needed."""

    lens: str
    name: str


@dataclass(frozen=True, kw_only=True)
class LensMount(Part):
    """A lens mount on a body. ``flange_mm`` None: lenses are screwed to focus (M12)."""

    flange_mm: float | None = None
    thread: str | None = None
    adapters: tuple[Adapter, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Head(Part):
    """A tripod head: ranges in degrees (pan right, tilt up, roll clockwise), step it is set in.

    ``pivot_mm`` is the height over its base at which its axes cross.
    """

    pan_deg: PairOf | None = None
    tilt_deg: PairOf | None = None
    roll_deg: PairOf | None = None
    step_deg: float | None = None
    load_kg: float | None = None
    height_mm: float | None = None
    pivot_mm: float | None = None
    width_mm: float | None = None
    mass_g: float | None = None
    base_thread: str | None = None
    camera_thread: str | None = None


@dataclass(frozen=True, kw_only=True)
class Profile(Part):
    """A T-slot profile. Inertias are about the axes along its width (x) and height (y)."""

    series: str
    width_mm: float
    height_mm: float
    slot_width_mm: float | None = None
    slot_spacing_mm: float | None = None
    bolt: str | None = None
    core_bore_mm: float | None = None
    mass_kg_per_m: float | None = None
    inertia_x_mm4: float | None = None
    inertia_y_mm4: float | None = None
    torsion_mm4: float | None = None
    elasticity_n_per_mm2: float | None = None


@dataclass(frozen=True, kw_only=True)
class Bracket(Part):
    """What joins profiles of the ``series`` named, or a profile and a head, or carries them.

    ``height_mm`` of a levelling foot: from the floor to what it is screwed to, least and greatest.
    """

    series: tuple[str, ...]
    size_mm: SizeOf | None = None
    leg_mm: float | None = None
    bolt: str | None = None
    bolts: int | None = None
    angle_deg: PairOf | None = None
    step_deg: float | None = None
    thread: str | None = None
    height_mm: PairOf | None = None
    load_kg: float | None = None
    mass_g: float | None = None


@dataclass(frozen=True, kw_only=True)
class Fastener(Part):
    """A screw, nut or stud, or an adapter from the stud ``inner_thread`` to a hole ``thread``."""

    thread: str
    inner_thread: str | None = None
    diameter_mm: float | None = None
    pitch_mm: float | None = None
    head_diameter_mm: float | None = None
    head_height_mm: float | None = None
    across_flats_mm: float | None = None
    key_mm: float | None = None
    series: str | None = None
    mass_g: float | None = None
