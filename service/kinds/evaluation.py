"""Evaluations: given cameras, scored with the figures of a design."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from rig.design.designfile import design_from_mapping
from rig.design.designmodel import DesignFile
from rig.specification.rigfile import RigFile
from service.kinds.base import Figure, JobKind, Note, Request, Result
from service.kinds.scanned import rig_for_scan


class EvaluationRequest(Request):
    """What to score: the cameras of ``design`` against the limits of ``rig``."""

    rig: Annotated[RigFile, Field(description="The structure of a rig file, as JSON.")]
    design: Annotated[
        DesignFile,
        Field(
            description="A design document; of an existing rig `schema` and `cameras` are enough."
        ),
    ]

    def placed_for_scan(self, options: Mapping[str, str | float]) -> EvaluationRequest:
        """Only what places the cameras, the scan read with its own ``options``.

        The figures of the old design would be stored for nothing. Raises
        :class:`~common.errors.InputError` for cameras that make no sense.
        """
        rig = rig_for_scan(self.rig, options)
        placed = self.design.model_dump(
            by_alias=True, exclude_unset=True, include={"schema_", "name", "cameras"}
        )
        design_from_mapping(placed, "design", rig.to_spec().camera)
        return EvaluationRequest(rig=rig, design=DesignFile.model_validate(placed))


class Coverage(Result):
    """Share of the region's points seen by ``views`` cameras or more."""

    views: int
    share: float


class EvaluationResult(Result):
    """The figures of given cameras."""

    feasible: Annotated[bool, Field(description="Whether every limit is satisfied.")]
    cameras: int
    cost_mm2: Figure
    sigma_median_mm: Figure
    sigma_p95_mm: Figure
    sigma_max_mm: Figure
    coverage: list[Coverage]
    in_focus_share: Figure
    in_frame_share: Figure
    matchable_share: Annotated[
        Figure,
        Field(description="Share in a matchable pair of cameras, of the points that can be."),
    ] = None
    groups: Annotated[
        list[list[str]] | None,
        Field(description="Cameras that hang together by the surface that they can match."),
    ] = None
    violated: Annotated[list[str], Field(description="Names of the limits that are broken.")]
    notes: Annotated[
        list[Note],
        Field(description="What was inferred or changed to read the scan and find the face."),
    ]


EVALUATION = JobKind("evaluation", EvaluationRequest, EvaluationResult)
