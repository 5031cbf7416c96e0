"""What a rig that stands is asked for: captures and tests."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rig.acquisition.session.records import CaptureRecord, VerdictEntry
from service.kinds.base import Figure, JobKind, Request, Result
from service.kinds.defaults import SYNC_CAPTURES

Identifier = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
"""Becomes a file name: the same letters as the ids of captures."""


class CaptureRequest(Request):
    """One capture. Sent again with the same `capture_id`, nothing is fired a second time."""

    capture_id: Annotated[Identifier, Field(description="A name you choose, never used before.")]
    session: Annotated[
        Identifier | None,
        Field(
            description="The session to file it in, begun if there is none of that name. Without "
            "it the capture gets a session of its own, named like the capture."
        ),
    ] = None
    subject: Annotated[str, Field(max_length=200, description="For a new session.")] = ""
    operator: Annotated[str, Field(max_length=200, description="For a new session.")] = ""
    shots: Annotated[int, Field(ge=1, le=1000)] = 1
    interval_us: Annotated[
        float, Field(ge=0.0, le=1e9, allow_inf_nan=False, description="From shot to shot.")
    ] = 0.0
    allow_partial: Annotated[
        bool | None,
        Field(description="Whether cameras may be missing; as the station says without it."),
    ] = None

    @property
    def session_name(self) -> str:
        """The session of the capture; one of its own when none was named."""
        return self.session or self.capture_id


class CaptureOutcome(Result):
    """A committed capture. Its pictures are files of the session."""

    session: str
    record: CaptureRecord


class RigTestRequest(Request):
    """A test of a rig; the first two fire nothing.

    `self-test` looks at box, clock, interlock, every camera and the disk. `dry-run` does all
    that a capture does up to FIRE. `sync-check` fires, files nothing, and tells each camera's lag.
    """

    test: Literal["self-test", "dry-run", "sync-check"]
    captures: Annotated[int, Field(ge=1, le=100, description="Of a `sync-check`.")] = SYNC_CAPTURES
    adopt: Annotated[
        bool, Field(description="Whether a `sync-check` writes its delays to the station file.")
    ] = False
    allow_partial: Annotated[bool | None, Field(description="Of a `dry-run`.")] = None
    shots: Annotated[int, Field(ge=1, le=1000, description="Of a `dry-run`.")] = 1
    interval_us: Annotated[
        float,
        Field(ge=0.0, le=1e9, allow_inf_nan=False, description="From shot to shot of a `dry-run`."),
    ] = 0.0


class CheckLine(Result):
    """One thing that was looked at."""

    name: str
    ok: bool
    text: str


class FaultLine(Result):
    """One thing that went wrong."""

    kind: str
    text: str
    camera: str | None
    shot: int | None


class LagLine(Result):
    """A camera's lag from its edge to its exposure."""

    camera: str
    lag_us: float
    jitter_us: Figure
    uncertainty_us: float
    count: int
    exposure_us: Figure
    source: str


class TimingLine(Result):
    """The delay that makes up for a camera's lag."""

    delay_us: float
    expected_lag_us: float


class RigTestOutcome(Result):
    """What a test found; lists that do not belong to the test are empty."""

    test: Literal["self-test", "dry-run", "sync-check"]
    ok: bool
    checks: list[CheckLine] = Field(default_factory=list)
    ready: Annotated[list[str], Field(description="Cameras that were ready.")] = Field(
        default_factory=list
    )
    seconds: float | None = None
    verdicts: list[VerdictEntry] = Field(default_factory=list)
    faults: list[FaultLine] = Field(default_factory=list)
    lags: dict[str, LagLine] = Field(default_factory=dict)
    timings: dict[str, TimingLine] | None = None
    why_not: str = ""
    adopted: bool = False


CAPTURE = JobKind("capture", CaptureRequest, CaptureOutcome)
RIG_TEST = JobKind("rig-test", RigTestRequest, RigTestOutcome)
