"""The study file: which rigs to compare, for whom, over which choices.

TOML in files, the same structure as JSON over HTTP. ``docs/how-to/studies.md`` explains the keys.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from common.files.strict import StrictModel, validated
from common.files.toml import parsed, read_text
from solver.strategy import Strategy

SCHEMA: Literal["rigwright.study/1"] = "rigwright.study/1"

MOST_UNITS = 20_000
"""A grid of more is a slip: at a minute each it would run for two weeks."""

Form = Literal["free", "symmetric"]
Positive = Annotated[float, Field(gt=0.0, le=1e6)]
Text = Annotated[str, Field(min_length=1, max_length=1000)]


class GridSection(StrictModel):
    """The choices, each with every other; what is left out is as the rig file has it."""

    cameras: list[Annotated[int, Field(ge=1, le=500)]] = Field(
        default_factory=list, description="How many cameras to place."
    )
    design_distance_mm: list[Positive] = Field(
        default_factory=list, description="Mean distance of neighbouring cameras, Eq 13."
    )
    neighbour_base_height: list[Positive] = Field(
        default_factory=list,
        description="Greatest base/height ratio of a camera and its nearest neighbour.",
    )
    form: list[Form] = Field(
        default_factory=list,
        description='`"free"` switches `[limits.symmetry]` off, `"symmetric"` on: as the rig file '
        "has it, or to 5 mm across.",
    )
    lens: list[Text] = Field(
        default_factory=list,
        description="Lenses of the catalogue, for the rig's camera, which must name its `model`.",
    )
    f_number: list[Positive] = Field(default_factory=list, description="Apertures.")
    strategy: list[Annotated[Strategy, Field(strict=False)]] = Field(
        default_factory=list, description="Where starts come from, as in a rig file."
    )
    seed: list[Annotated[int, Field(ge=0, le=2**53 - 1)]] = Field(
        default_factory=list, description="Seeds of everything random."
    )

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for name in type(self).model_fields:
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ValueError(f"{name} holds a value twice; give each once")
        return self


class PopulationSection(StrictModel):
    """Heads drawn from the bundled head's measures as they vary among adults."""

    heads: int = Field(ge=1, le=1000, description="How many.")
    seed: int = Field(default=1, ge=0, le=2**53 - 2000, description="Seed of the first.")


class PricesSection(StrictModel):
    """What a camera of the rig costs, by parts of the catalogue."""

    currency: str = Field(default="", max_length=10, description="What to call the money.")
    each: dict[str, Annotated[float, Field(ge=0.0)]] = Field(
        default_factory=dict, description="Price of one piece by catalogue id (camera, lens)."
    )
    camera: float | None = Field(
        default=None, ge=0.0, description="Price of a camera with its lens, whichever they are."
    )


class RecommendSection(StrictModel):
    """Which rig of the study to recommend."""

    sigma_p95_max_mm: float | None = Field(
        default=None,
        gt=0.0,
        description="The accuracy that is wanted: the fewest cameras that reach it.",
    )
    camera_worth_share: float = Field(
        default=0.1,
        gt=0.0,
        lt=1.0,
        description="Without that: by which share one camera more must lower the sigma to be "
        "worth it.",
    )


class Study(StrictModel):
    """What is asked of a study, apart from the files it is about."""

    name: str = Field(
        default="study", min_length=1, max_length=200, description="What to call the study."
    )
    starts: int | None = Field(
        default=None, ge=1, le=1000, description="Starts of each design, instead of the rig's."
    )
    grid: GridSection = Field(default_factory=GridSection, description="The choices.")
    population: PopulationSection | None = Field(
        default=None, description="Heads drawn at random, besides the files."
    )
    prices: PricesSection = Field(default_factory=PricesSection, description="Prices.")
    recommend: RecommendSection = Field(
        default_factory=RecommendSection, description="What to recommend."
    )

    def population_seeds(self) -> Iterator[int]:
        """The seed of each head that is drawn."""
        if self.population is not None:
            first = self.population.seed
            yield from range(first, first + self.population.heads)


class StudyFile(Study):
    """The root of a study file."""

    schema_: Literal["rigwright.study/1"] = Field(
        alias="schema", description='Version of the format: `"rigwright.study/1"`.'
    )
    rigs: list[Text] = Field(min_length=1, max_length=100, description="Rig files.")
    heads: list[Text] = Field(
        default_factory=list,
        max_length=1000,
        description="Scans, as for a design. Without any, and without `[population]`: the bundled "
        "head.",
    )

    def study(self) -> Study:
        """The part that stands in no other file; what the file leaves out is left out."""
        said = self.model_fields_set.intersection(Study.model_fields)
        return Study(**{name: getattr(self, name) for name in said})


def read_study_file(path: Path) -> StudyFile:
    """A study from a file; raises a one-line :class:`InputError`.

    Its paths are as they stand there: from the folder of the file.
    """
    return parse_study(read_text(path, "study", "study file"), path.name)


def parse_study(text: str, name: str) -> StudyFile:
    """The same from its text; ``name`` stands in front of every error."""
    return validated(StudyFile, parsed(text, name, "study", "study file"), name)
