"""Studies: a grid of designs, compared."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from rig.specification.rigfile import RigFile
from rig.study.studyfile import Study
from service.kinds.base import Figure, JobKind, Request, Result


class StudyRequest(Request):
    """Which rigs to compare over which choices. The scans are the job's inputs."""

    study: Annotated[Study, Field(description="The structure of a study file, without its paths.")]
    rigs: Annotated[
        list[RigFile],
        Field(min_length=1, max_length=100, description="The structures of rig files, as JSON."),
    ]
    head_names: Annotated[
        list[Annotated[str, Field(max_length=200)]],
        Field(
            default_factory=list,
            max_length=1000,
            description="What to call the scans, in their order.",
        ),
    ]


class Recommended(Result):
    """The rig to build, in short."""

    choice: str
    rig: str
    head: str
    cameras: int
    sigma_median_mm: Figure
    sigma_p95_mm: Figure
    size_mm: list[float]
    price: Figure


class StudyResult(Result):
    """What a study found, in short."""

    name: str
    designs: int
    feasible: Annotated[int, Field(description="Designs that hold every limit.")]
    reused: Annotated[int, Field(description="Designs that were finished before.")]
    on_front: Annotated[int, Field(description="Designs on the Pareto front.")]
    recommended: Recommended | None
    why: str


STUDY = JobKind("study", StudyRequest, StudyResult)
