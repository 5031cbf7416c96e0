"""What requests and results have in common, and how a job's row holds them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from common.errors import InternalError

LARGEST_JSON_INTEGER = 2**53 - 1
"""Beyond it JSON readers that use floating point, as browsers do, see another number."""

Id = Annotated[str, Field(min_length=1, max_length=100)]


class Model(BaseModel):
    """Base of everything on the wire: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Request(Model):
    """What is asked for, apart from the files it is about."""


class Result(Model):
    """What came of a job in short; its files hold the rest."""


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Figure = Annotated[float | None, BeforeValidator(_finite)]
"""A number, or null where there is none: JSON has neither NaN nor infinity."""


class Note(Model):
    """Something that was inferred about a scan, changed in it, or looks odd."""

    kind: Literal["inferred", "changed", "warning"]
    text: str


class RunContext(Model):
    """What goes with a request: nobody asked for it, or it says where things lie.

    ``workers``: processes that may be used. ``scan_name``: what the scan is called in reports.
    ``made_utc``: when it was asked for, ISO 8601. ``reference``: what a calibration is called.
    ``session`` and its ``captures`` (all without any), or the folder ``pictures``: where pictures
    are that come as no input file. ``cache``: a folder where finished parts are found and kept.
    ``cluster``: the address of who computes them, instead of processes of this machine.
    ``blender``: the program that photographs instead of the simulated studio.
    """

    workers: int = 1
    scan_name: str = ""
    made_utc: str = ""
    reference: str = ""
    session: str | None = None
    captures: list[str] = Field(default_factory=list)
    pictures: str | None = None
    cache: str | None = None
    cluster: str | None = None
    blender: str | None = None


RequestT = TypeVar("RequestT", bound=Request)
ResultT = TypeVar("ResultT", bound=Result)


@dataclass(frozen=True)
class JobKind(Generic[RequestT, ResultT]):
    """A kind of work, known by its name.

    ``time_limit_s`` and ``memory_limit_bytes`` (address space) end work that takes too much;
    None: no limit.
    """

    name: str
    request: type[RequestT]
    result: type[ResultT]
    time_limit_s: float | None = None
    memory_limit_bytes: int | None = None

    def row(self, request: RequestT, run: RunContext) -> dict[str, object]:
        """Both as one JSON object: what a job's row holds."""
        asked = request.model_dump(mode="json", by_alias=True, exclude_unset=True)
        return asked | run.model_dump(mode="json", exclude_defaults=True)

    def from_row(self, row: Mapping[str, object]) -> tuple[RequestT, RunContext]:
        """The two of a row again. Raises :class:`InternalError` for one of another version."""
        own = set(RunContext.model_fields)
        try:
            asked = json.dumps({k: v for k, v in row.items() if k not in own})
            return (
                self.request.model_validate_json(asked),
                RunContext.model_validate({k: v for k, v in row.items() if k in own}),
            )
        except ValidationError as error:
            raise InternalError(
                "job-request",
                f"another version of the program asked for this {self.name}",
                "ask for it again",
            ) from error

    def result_row(self, result: ResultT) -> dict[str, object]:
        """A result as one JSON object."""
        return result.model_dump(mode="json", by_alias=True)

    def result_from_row(self, row: Mapping[str, object] | None) -> ResultT | None:
        """The result of a row; None where there is none."""
        return None if row is None else self.result.model_validate_json(json.dumps(row))
