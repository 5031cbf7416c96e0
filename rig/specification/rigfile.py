"""The rig file: what a rig is made of and what it must respect, as a person writes it.

TOML in files, the same structure as JSON over HTTP. ``docs/reference/rig-file.md`` lists the keys.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal, Self

from pydantic import Field

from common.files.strict import StrictModel, validated
from common.files.toml import parsed, read_text
from rig.catalogue import Catalogue
from rig.specification.sections.camera import CameraSection
from rig.specification.sections.limits import LimitsSection
from rig.specification.sections.matching import MatchingSection
from rig.specification.sections.parts import CATALOGUE
from rig.specification.sections.poses import FixedSection, StartSection
from rig.specification.sections.subject import ScanSection, SubjectSection
from rig.specification.spec import RigSpec
from solver.strategy import Strategy

SCHEMA: Literal["rigwright.rig/1"] = "rigwright.rig/1"
"""A rig file is a page or two; a larger one is another file given by mistake."""


class RigFile(StrictModel):
    """The root of a rig file."""

    schema_: Literal["rigwright.rig/1"] = Field(
        alias="schema", description='Version of the format: `"rigwright.rig/1"`.'
    )
    name: str = Field(
        default="rig", min_length=1, max_length=200, description="What to call the rig."
    )
    cameras: int | None = Field(
        default=None,
        ge=0,
        le=500,
        description="How many cameras to place, fixed ones not counted; 0 for a rig that stands. "
        "Without it: as many as there are `[[start]]` poses, or 7.",
    )
    seed: int = Field(default=0, ge=0, le=2**53 - 1, description="Seed of everything random.")
    starts: int = Field(
        default=8,
        ge=1,
        le=1000,
        description='How many starts to try; with the strategy `"exchange"` how many of the best '
        "networks are moved, of which more than two never pay, and how many starts are tried where "
        "the search does not do.",
    )
    strategy: Strategy = Field(
        default=Strategy.EXCHANGE,
        strict=False,
        description='Where starts come from: `"exchange"` searches networks among candidate poses '
        'and moves the best two; `"k-means"` clusters the points, as the source paper does, and '
        "tries the best strip and clusters jittered, as is done where the search does not do: with "
        "spacing, symmetry, bounds or limits of a mean, or when nothing in it meets the limits; "
        '`"strip"` moves strips of several spans; `"next-best-view"` moves one network '
        'of candidates, each put where it helps those before it most; `"filtering"` moves what is '
        "left when the candidate that is missed least goes, again and again. "
        "Where `[[start]]` poses are given it has no say.",
    )
    camera: CameraSection = Field(description="The kind of camera.")
    limits: LimitsSection = Field(
        default_factory=LimitsSection, description="What the rig must respect."
    )
    matching: MatchingSection = Field(
        default_factory=MatchingSection, description="What a dense matcher can use."
    )
    fixed: list[FixedSection] = Field(default_factory=list, description="Cameras that stay.")
    start: list[StartSection] = Field(default_factory=list, description="Poses to start from.")
    scan: ScanSection = Field(default_factory=ScanSection, description="How to read the scan.")
    subject: SubjectSection = Field(
        default_factory=SubjectSection, description="Which part of it to design for."
    )

    def to_spec(self) -> RigSpec:
        """The rig as the rest of the program sees it; checks what only shows in the whole."""
        camera = self.camera.to_camera()
        return RigSpec(
            name=self.name,
            camera=camera,
            count=(len(self.start) or 7) if self.cameras is None else self.cameras,
            seed=self.seed,
            starts=self.starts,
            strategy=self.strategy,
            limits=replace(self.limits.to_limits(), matching=self.matching.to_matching()),
            fixed=tuple(section.to_rig_camera(camera) for section in self.fixed),
            start=tuple(section.to_pose() for section in self.start),
            scan_options=self.scan.to_options(),
            subject_options=self.subject.to_options(self.seed),
        )

    @classmethod
    def from_spec(cls, spec: RigSpec) -> Self:
        """The file that describes ``spec``: what a design is filed with."""
        return cls(
            schema=SCHEMA,
            name=spec.name,
            cameras=spec.count,
            seed=spec.seed,
            starts=spec.starts,
            strategy=spec.strategy,
            camera=CameraSection.from_camera(spec.camera),
            limits=LimitsSection.from_limits(spec.limits),
            matching=MatchingSection.from_matching(spec.limits.matching),
            fixed=[FixedSection.from_rig_camera(camera) for camera in spec.fixed],
            start=[StartSection.from_pose(pose) for pose in spec.start],
            scan=ScanSection.from_options(spec.scan_options),
            subject=SubjectSection.from_options(spec.subject_options),
        )


def rig_from_mapping(
    data: Mapping[str, object], name: str = "rig", catalogue: Catalogue | None = None
) -> RigSpec:
    """A rig from parsed TOML or JSON; ``name`` stands in front of every error.

    ``catalogue`` supplies the parts it names; without it, the one that comes with the program.
    """
    return validated(RigFile, data, name, {CATALOGUE: catalogue}).to_spec()


def parse_rig(text: str, name: str = "rig", catalogue: Catalogue | None = None) -> RigSpec:
    """A rig from the text of a rig file; raises a one-line :class:`InputError`."""
    return rig_from_mapping(parsed(text, name, "rig", "rig file"), name, catalogue)


def read_rig_file(path: Path) -> RigFile:
    """The same before it is put together: as it can be handed on."""
    return parse_rig_file(read_text(path, "rig", "rig file"), path.name)


def parse_rig_file(text: str, name: str) -> RigFile:
    """The same from its text; ``name`` stands in front of every error."""
    return validated(RigFile, parsed(text, name, "rig", "rig file"), name)


def read_rig(path: Path, catalogue: Catalogue | None = None) -> RigSpec:
    """A rig from a file; raises a one-line :class:`InputError`."""
    return parse_rig(read_text(path, "rig", "rig file"), path.name, catalogue)
