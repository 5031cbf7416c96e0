"""A study's grid: each choice as a rig file of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

from pydantic import Field

from common.errors import InputError
from common.files.strict import StrictModel, validated
from rig.catalogue import load_catalogue
from rig.specification.rigfile import RigFile
from rig.study.studyfile import MOST_UNITS, Form, Study
from solver.strategy import Strategy

SPACING_TOLERANCE_SHARE = 0.05
"""How far the mean edge may be off the design distance where the rig file says nothing."""

SYMMETRY_TOLERANCE_MM = 5.0

KEPT_BY_A_LENS = ("image_size_px", "pixel_pitch_um", "f_number", "circle_of_confusion_um")
"""What a camera keeps when it gets another lens; the rest is the lens's own."""


class Choice(StrictModel):
    """One point of the grid. None: as the rig file has it."""

    rig: str
    head: str = Field(description="The head it was designed for.")
    cameras: int | None = None
    design_distance_mm: float | None = None
    neighbour_base_height: float | None = None
    form: Form | None = None
    lens: str | None = None
    f_number: float | None = None
    strategy: Strategy | None = Field(default=None, strict=False)
    seed: int | None = None

    def words(self) -> str:
        """The choice as a person would say it, without rig, head and seed."""
        given = (
            (self.cameras, "{} cameras"),
            (self.design_distance_mm, "{:g} mm apart"),
            (self.neighbour_base_height, "base/height {:g}"),
            (self.form, "{}"),
            (self.lens, "{}"),
            (self.f_number, "f/{:g}"),
            (self.strategy, "{}"),
        )
        return ", ".join(form.format(value) for value, form in given if value is not None)


def choices(study: Study, rig_names: Sequence[str], head_names: Sequence[str]) -> list[Choice]:
    """All points of the grid, in the order of the file.

    Raises :class:`InputError` where there are too many, or a lens is not in the catalogue.
    """
    grid = study.grid
    for lens in grid.lens:
        load_catalogue().lens(lens)
    axes = {name: getattr(grid, name) or [None] for name in type(grid).model_fields}
    count = len(rig_names) * len(head_names)
    for values in axes.values():
        count *= len(values)
    if count > MOST_UNITS:
        raise InputError(
            "study-size",
            f"the grid has {count} designs",
            f"leave choices out until there are at most {MOST_UNITS}",
        )
    return list(_points(axes, rig_names, head_names))


def _points(
    axes: dict[str, list[Any]], rig_names: Sequence[str], head_names: Sequence[str]
) -> Iterator[Choice]:
    for rig, *values, head in product(rig_names, *axes.values(), head_names):
        yield Choice(rig=rig, head=head, **dict(zip(axes, values, strict=True)))


def rig_of(choice: Choice, rig: RigFile, study: Study) -> RigFile:
    """The rig file of one choice. Raises :class:`InputError` where it cannot be."""
    data: dict[str, Any] = rig.model_dump(by_alias=True, exclude_none=True)
    given = {
        "cameras": choice.cameras,
        "seed": choice.seed,
        "strategy": choice.strategy,
        "starts": study.starts,
    }
    data |= {name: value for name, value in given.items() if value is not None}
    _set_limits(data["limits"], choice)
    if choice.lens is not None:
        data["camera"] = _with_lens(data["camera"], choice)
    if choice.f_number is not None:
        data["camera"]["f_number"] = choice.f_number
    made = validated(RigFile, data, choice.rig)
    made.to_spec()
    return made


def _set_limits(limits: dict[str, Any], choice: Choice) -> None:
    edge_mm, ratio = choice.design_distance_mm, choice.neighbour_base_height
    if edge_mm is not None:
        own = limits.get("spacing")
        share = own["tolerance_mm"] / own["edge_mm"] if own else SPACING_TOLERANCE_SHARE
        limits["spacing"] = {"edge_mm": edge_mm, "tolerance_mm": share * edge_mm}
    if ratio is not None:
        limits["base_height"] = limits.get("base_height", {}) | {
            "enabled": True,
            "neighbour_max": ratio,
        }
    if choice.form is not None:
        own = {"median_tolerance_mm": SYMMETRY_TOLERANCE_MM}
        own |= {"balance_tolerance_mm": SYMMETRY_TOLERANCE_MM}
        limits["symmetry"] = limits.get("symmetry", own) | {"enabled": choice.form == "symmetric"}


def _with_lens(camera: dict[str, Any], choice: Choice) -> dict[str, Any]:
    """The camera with another lens of the catalogue: what the old one gave is left out."""
    if "model" not in camera:
        raise InputError(
            "study-lens",
            f"the camera of {choice.rig} is described by its figures, so no lens can be put on it",
            "name it by [camera] model, or leave lens out of the grid",
        )
    kept = {name: camera[name] for name in ("model", *KEPT_BY_A_LENS) if name in camera}
    return kept | {"lens": choice.lens}
