"""One unit of a study: a design with its figures. What is asked, what comes of it, its key."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from common.files.plain import number
from common.files.strict import StrictModel, Vector
from common.version import program_version
from rig.specification.rigfile import RigFile

SCHEMA: Literal["rigwright.study-unit/1"] = "rigwright.study-unit/1"


def _finite(value: object) -> object:
    return number(value) if isinstance(value, float) else value


Figure = Annotated[float | None, BeforeValidator(_finite)]
"""A number, or null where there is none: JSON has neither NaN nor infinity."""


class Head(StrictModel):
    """A head: a file by its content, or one that is drawn from its seed, or the bundled one."""

    name: str
    sha256: str | None = None
    seed: int | None = None

    def identity(self) -> str:
        """What it is, whatever it is called."""
        return self.sha256 or f"seed {self.seed}"


class Unit(StrictModel):
    """What is asked: a rig designed for one of the ``heads`` and scored on all of them."""

    rig: RigFile
    heads: list[Head] = Field(min_length=1)
    designed_for: int = Field(ge=0)

    def key(self) -> str:
        """The hash of all that the result depends on, the program included."""
        asked = {
            "rig": self.rig.model_dump(mode="json", by_alias=True),
            "heads": [head.identity() for head in self.heads],
            "designed_for": self.designed_for,
            "program": [program_version(), program_sha256()],
        }
        text = json.dumps(asked, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


class HeadFigures(StrictModel):
    """How well a rig measures one head. ``violated``: families of limits it breaks there."""

    head: str
    violated: list[str]
    cost_mm2: Figure
    sigma_median_mm: Figure
    sigma_p95_mm: Figure
    sigma_max_mm: Figure
    seen_twice_share: float
    seen_thrice_share: float
    in_frame_share: float
    in_focus_share: float


class Place(StrictModel):
    """Where a camera stands and looks, in the rig frame."""

    name: str
    position_mm: Vector
    looks_along: Vector = Field(description="Unit vector of its optical axis.")


class UnitResult(StrictModel):
    """What came of a unit. Without ``heads`` there is no rig, and ``reason`` says why."""

    schema_: Literal["rigwright.study-unit/1"] = Field(default=SCHEMA, alias="schema")
    key: str
    reason: str = Field(default="", description="Why it is no rig that can be had; empty: it is.")
    heads: list[HeadFigures] = Field(default_factory=list)
    designed_for: int = 0
    centre_mm: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    places: list[Place] = Field(default_factory=list)
    size_mm: Vector = Field(
        default_factory=lambda: [0.0, 0.0, 0.0],
        description="The array with its bodies: across (X), in depth (Y), in height (Z).",
    )

    def worst_p95_mm(self) -> float:
        """The 95 % sigma on the head where it is worst; infinity where there is none."""
        found = [h.sigma_p95_mm for h in self.heads]
        return max((float("inf") if v is None else v for v in found), default=float("inf"))

    def holds_on(self) -> int:
        """On how many heads every limit holds."""
        return sum(not head.violated for head in self.heads)


@lru_cache(maxsize=1)
def program_sha256() -> str:
    """The hash of the code and data that designs depend on.

    A version may stand for many states of the code while somebody works on it.
    """
    root, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    parts = ("geometry", "solver", "rig/catalogue", "rig/specification", "rig/solids")
    folders = [path for part in parts for path in sorted((root / part).rglob("*"))]
    for path in (*folders, root / "rig/study/solving.py", root / "rig/study/unit.py"):
        if path.suffix in (".py", ".toml", ".npz"):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
