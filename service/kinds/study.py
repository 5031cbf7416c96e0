"""Studies: a grid of designs, compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Self

from pydantic import Field

from common.errors import InputError
from rig.specification.rigfile import RigFile
from rig.study.grid import choices, rig_of
from rig.study.heads import ROLE
from rig.study.studyfile import Study
from service.kinds.base import Figure, JobKind, Model, Request, Result
from service.kinds.scanned import rig_for_scan

_TRIED = 200
"""Designs that are looked at before a study is taken; those after it are looked at in the job."""


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

    def for_scans(self, names: Sequence[str], options: Mapping[str, str | float]) -> Self:
        """The same for scans, read with their own ``options`` where a rig has none."""
        rigs = [rig_for_scan(rig, options) for rig in self.rigs]
        return self.model_copy(update={"rigs": rigs, "head_names": self.head_names or list(names)})

    def check(self) -> None:
        """Refuse what can be seen to be wrong within a second.

        Raises :class:`~common.errors.InputError` for a grid that is too large and where its first
        designs cannot be, :class:`~common.errors.NotFoundError` for lenses that are not there.
        """
        rigs = [str(number) for number in range(len(self.rigs))]
        asked = choices(self.study, rigs, ["a head"])[:_TRIED]
        refused = None
        for choice in asked:
            try:
                rig_of(choice, self.rigs[int(choice.rig)], self.study)
            except InputError as error:
                refused = refused or error
            else:
                return
        if refused is not None and len(asked) < _TRIED:
            raise refused


class FileText(Request):
    """A file of TOML: what it is called, and what it says."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    text: Annotated[str, Field(max_length=1_000_000)]


class StudyFiles(Request):
    """A study file and the rig files that it names, found by their names without folders."""

    study: FileText
    rigs: Annotated[list[FileText], Field(max_length=100)]


class ReadStudy(Model):
    """What a study file asks for, to be sent with the ids of scans."""

    study: Study
    rigs: list[RigFile]
    heads: Annotated[list[str], Field(description="Names of scan files, without folders.")]


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


def head_role(number: int) -> str:
    """What the scan of this number, from 1, is called among the inputs."""
    return ROLE.format(number)
