"""The system file: which mount to plan, as a person writes it.

``docs/reference/mounts.md`` lists the keys. ``kind`` alone is enough.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from common.errors import InputError, NotFoundError
from common.files.strict import StrictModel, Vector, validated
from common.files.toml import parsed, read_text
from rig.build.mounts.making import SystemSpec
from rig.build.mounts.surroundings import Zone
from rig.build.mounts.systems.arc import ArcSystem
from rig.build.mounts.systems.base import MountSystem
from rig.build.mounts.systems.heads import HeadKind
from rig.build.mounts.systems.parts import (
    bracket_for,
    outrigger_of,
    plate_of,
    profile_named,
    stand_named,
)
from rig.build.mounts.systems.threads import adapter_for
from rig.build.mounts.systems.tripods import TripodSystem
from rig.build.mounts.systems.tslot import TSlotSystem
from rig.build.statics.weights import Masses
from rig.catalogue import Catalogue, load_catalogue
from rig.catalogue.items import Profile

SCHEMA: Literal["rigwright.mount/1"] = "rigwright.mount/1"


class ZoneSection(StrictModel):
    """A box that stays free."""

    name: str = Field(default="light", min_length=1, max_length=80, description="What it is for.")
    low_mm: Vector = Field(description="Its least corner in the rig frame.")
    high_mm: Vector = Field(description="Its greatest corner.")

    @model_validator(mode="after")
    def _in_order(self) -> ZoneSection:
        if not all(low < high for low, high in zip(self.low_mm, self.high_mm, strict=True)):
            raise ValueError("give low_mm below high_mm in x, y and z")
        return self


class SystemFile(StrictModel):
    """The root of a system file."""

    schema_: Literal["rigwright.mount/1"] = Field(
        default=SCHEMA, alias="schema", description='Version of the format: `"rigwright.mount/1"`.'
    )
    kind: Literal["t-slot", "plate", "arc", "tripods"] = Field(description="Kind of mount.")
    name: str = Field(
        default="", max_length=200, description="What to call the mount; its kind without it."
    )
    profile: str | None = Field(
        default=None, description="Profile of the catalogue; 2040 for a plate, else 2020."
    )
    head: str = Field(default="generic-ball-25", description="Head of the catalogue.")
    slot_step_mm: float = Field(
        default=1.0, gt=0.0, le=50.0, description="To what a slide can be set."
    )
    head_step_deg: float | None = Field(
        default=None, gt=0.0, le=10.0, description="To what a head can be set, if not as listed."
    )
    radius_mm: float | None = Field(
        default=None, gt=0.0, le=1e5,
        description="Radius of an arc's ribs. Without it: as small as the cameras allow.",
    )  # fmt: skip
    thickness_mm: float = Field(default=10.0, gt=0.0, le=100.0, description="Thickness of a plate.")
    material: str = Field(
        default="aluminium EN AW-5083", max_length=100, description="What a plate is made of."
    )
    stand: str = Field(default="tripod-1800", description="Tripod of the catalogue.")
    floor_step_mm: float = Field(
        default=1.0, gt=0.0, le=100.0, description="To what a tripod can be put on the floor."
    )
    share_mm: float = Field(
        default=150.0, ge=0.0, le=400.0,
        description="How far beside an upright or a rail a camera may still hang on it.",
    )  # fmt: skip
    clearance_mm: float = Field(
        default=2.0, ge=0.0, le=100.0, description="Least gap between parts that do not touch."
    )
    spare: float = Field(
        default=1.0, ge=0.0, le=2.0,
        description="How much of the effect of settings half a step off the limits are kept clear "
        "of; 0 keeps the limits only.",
    )  # fmt: skip
    floor_z_mm: float | None = Field(
        default=None, description="Height of the floor. Without it: 1200 mm under the datum."
    )
    head_entry: bool = Field(
        default=True, description="Keep the way free by which the subject comes and goes."
    )
    zone: list[ZoneSection] = Field(
        default_factory=list, description="Boxes that stay free, for lights above all."
    )
    prices: dict[str, float] = Field(
        default_factory=dict, description="Price of a part by its catalogue id; profiles per metre."
    )
    bar_mm: float = Field(
        default=3000.0, gt=100.0, le=20_000.0, description="Length of the bars that are bought."
    )
    kerf_mm: float = Field(default=3.0, ge=0.0, le=20.0, description="What a cut of the saw takes.")
    camera_kg: float = Field(
        default=0.5, gt=0.0, le=20.0,
        description="Mass of a camera with its lens, where the catalogue does not say it.",
    )  # fmt: skip
    stiffen: bool = Field(
        default=True,
        description="Build in back-stays, and a larger profile where none is named, if cameras "
        "would lean.",
    )
    levelling_feet: bool = Field(
        default=True,
        description="Stand a frame, an arc or a plate on levelling feet; else on its members.",
    )
    currency: str = Field(default="EUR", max_length=8, description="Currency of the prices.")

    def to_spec(self, catalogue: Catalogue) -> SystemSpec:
        """The mount as the rest of the program sees it."""
        return SystemSpec(
            name=self.name or self.kind,
            system=self._system(catalogue),
            zones=tuple(Zone(z.name, np.array(z.low_mm), np.array(z.high_mm)) for z in self.zone),
            entry=self.head_entry,
            floor_z_mm=self.floor_z_mm,
            clearance_mm=self.clearance_mm,
            spare=self.spare,
            prices=dict(self.prices),
            currency=self.currency,
            masses=Masses(catalogue, self.camera_kg),
            larger=self._larger(catalogue),
            stiffen=self.stiffen,
        )

    def checked(self, catalogue: Catalogue, name: str = "mount") -> SystemSpec:
        """The same; :class:`InputError`, with ``name`` before it, for parts that there are not."""
        try:
            return self.to_spec(catalogue)
        except NotFoundError as error:
            # It is not what was asked for that is missing, but what the file names.
            raise InputError(error.detail, f"{name}: {error.problem}", error.remedy) from error

    def _larger(self, catalogue: Catalogue) -> tuple[tuple[Profile, MountSystem], ...]:
        """The same mount with stays, of each profile that may be taken instead."""
        if self.profile is not None or self.kind not in ("t-slot", "arc"):
            return ()
        found = []
        for profile in (profile_named(name, catalogue) for name in _LARGER):
            system = self._system(catalogue, profile)
            if isinstance(system, TSlotSystem | ArcSystem):
                found.append((profile, replace(system, stays=True)))
        return tuple(found)

    def _system(self, catalogue: Catalogue, profile: Profile | None = None) -> MountSystem:
        profile = profile or profile_named(self.profile or _PROFILES[self.kind], catalogue)
        if self.kind == "plate":
            return plate_of(
                profile, self.thickness_mm, self.material, catalogue, level=self.levelling_feet
            )
        head = HeadKind.named(self.head, catalogue)
        if self.head_step_deg is not None:
            head = replace(head, step_deg=self.head_step_deg)
        if self.kind == "tripods":
            stand = stand_named(self.stand, catalogue)
            adapter = adapter_for(
                stand.thread, head.part.base_thread, f"head {head.part.id}", catalogue
            )
            return TripodSystem(stand, head, adapter, self.floor_step_mm, self.slot_step_mm)
        parts = outrigger_of(profile, head, catalogue, level=self.levelling_feet)
        if self.kind == "arc":
            strip = bracket_for(profile, "strip", catalogue)
            return ArcSystem(parts, strip, self.slot_step_mm, self.share_mm, self.radius_mm)
        return TSlotSystem(parts, self.slot_step_mm, self.share_mm)


_LARGER = ("3030", "4040")
_PROFILES = {"t-slot": "2020", "plate": "2040", "arc": "2020", "tripods": "2020"}


def system_from_mapping(
    data: Mapping[str, object], name: str = "mount", catalogue: Catalogue | None = None
) -> SystemSpec:
    """A mount system from parsed TOML or JSON; ``name`` stands in front of every error."""
    return validated(SystemFile, data, name).checked(catalogue or load_catalogue(), name)


def parse_system(text: str, name: str = "mount", catalogue: Catalogue | None = None) -> SystemSpec:
    """A mount system from the text of a file; raises a one-line :class:`InputError`."""
    return system_from_mapping(parsed(text, name, "mount", "system file"), name, catalogue)


def read_system_file(path: Path) -> SystemFile:
    """The same before its parts are looked up: as it can be handed on."""
    data = parsed(read_text(path, "mount", "system file"), path.name, "mount", "system file")
    return validated(SystemFile, data, path.name)


def read_system(path: Path, catalogue: Catalogue | None = None) -> SystemSpec:
    """A mount system from a file; raises a one-line :class:`InputError`."""
    return parse_system(read_text(path, "mount", "system file"), path.name, catalogue)
