"""A rig that a running service owns: what it is asked for, and how what it does is followed."""

from __future__ import annotations

import time
from contextlib import suppress
from threading import Event
from typing import Generic, TypeVar
from urllib.parse import quote

from common.errors import CancelledError, ConflictError, DeviceError, InternalError, RigwrightError
from common.progress import Progress, ProgressCallback
from service.client.asking import ProblemSeen, Seen, Service
from service.kinds.base import Result
from service.kinds.rigs import CaptureOutcome, CaptureRequest, RigTestOutcome, RigTestRequest
from service.kinds.sessions import CaptureRecord
from service.stations.status import CameraStatus, TriggerStatus

_LOOK_EVERY_S = 0.1
_PATIENCE_S = 15.0
"""How long a service may be away while it is followed: so long a restart takes."""

OutcomeT = TypeVar("OutcomeT", bound=Result)


class ProgressSeen(Seen):
    """How far a job is."""

    stage: str
    fraction: float


class JobSeen(Seen, Generic[OutcomeT]):
    """A job as far as whoever waits for it looks at it."""

    id: str
    status: str
    progress: ProgressSeen | None = None
    result: OutcomeT | None = None
    problem: ProblemSeen | None = None


class CaptureSeen(JobSeen[CaptureOutcome]):
    """A capture."""


class RigTestSeen(JobSeen[RigTestOutcome]):
    """A test of a rig."""


class RigSeen(Seen):
    """A rig and its devices."""

    name: str
    status: str
    doing: str | None
    problem: ProblemSeen | None
    trigger: TriggerStatus | None
    cameras: list[CameraStatus]


class RigsSeen(Seen):
    """All rigs of a service."""

    items: list[RigSeen]


SeenT = TypeVar("SeenT", CaptureSeen, RigTestSeen)


class ServedRig:
    """The rig ``name`` of a service."""

    def __init__(self, service: Service, name: str) -> None:
        self.service = service
        self.name = name
        self._path = f"rigs/{quote(name, safe='')}"

    def status(self) -> RigSeen:
        """How the rig and its devices are."""
        return self.service.read(self._path, RigSeen)

    def abort(self) -> RigSeen:
        """All outputs low, and an end to what the rig does."""
        return self.service.send(f"{self._path}/abort", None, RigSeen)

    def reset(self) -> RigSeen:
        """Let the trigger box leave its fault."""
        return self.service.send(f"{self._path}/reset", None, RigSeen)

    def capture(
        self, request: CaptureRequest, progress: ProgressCallback, cancel: Event
    ) -> tuple[CaptureRecord, RigwrightError | None]:
        """Take a capture: its record, and what is wrong with one that is filed but not whole.

        Raises what kept it from being taken. ``cancel`` ends it there.
        """
        job = self._asked_once(request)
        job = self._followed("captures", job, CaptureSeen, progress, cancel)
        if job.result is not None:
            return job.result.record, None
        error = _error_of(job)
        if error.code != "device/capture-partial":
            raise error
        filed = f"sessions/{quote(request.session_name)}/captures/{quote(request.capture_id)}"
        return self.service.read(filed, CaptureRecord), error

    def test(
        self, request: RigTestRequest, progress: ProgressCallback, cancel: Event
    ) -> RigTestOutcome:
        """Test the rig. Raises what kept it from being tested."""
        job = self.service.send(f"{self._path}/tests", request, RigTestSeen)
        job = self._followed("rig-tests", job, RigTestSeen, progress, cancel)
        if job.result is None:
            raise _error_of(job)
        return job.result

    def _asked_once(self, request: CaptureRequest) -> CaptureSeen:
        """The capture, asked for again where the answer was lost: its id is fired once for ever."""
        ask = f"{self._path}/captures"
        try:
            return self.service.send(ask, request, CaptureSeen)
        except DeviceError as error:
            if error.detail != "service-gone":
                raise
            return self.service.send(ask, request, CaptureSeen)

    def _followed(
        self,
        plural: str,
        job: SeenT,
        model: type[SeenT],
        progress: ProgressCallback,
        cancel: Event,
    ) -> SeenT:
        path = f"{plural}/{quote(job.id)}"
        stopping = False
        while job.status in ("pending", "running"):
            if cancel.is_set() and not stopping:
                with suppress(ConflictError):
                    self.service.send(f"{path}/cancel", None, model)
                stopping = True
            _tell(job, progress)
            time.sleep(_LOOK_EVERY_S)
            job = self._read_patiently(path, model)
        _tell(job, progress)
        return job

    def _read_patiently(self, path: str, model: type[SeenT]) -> SeenT:
        until_s = time.monotonic() + _PATIENCE_S
        while True:
            try:
                return self.service.read(path, model)
            except DeviceError as error:
                if error.detail != "service-gone" or time.monotonic() > until_s:
                    raise
            time.sleep(_LOOK_EVERY_S)


def _tell(job: JobSeen[OutcomeT], progress: ProgressCallback) -> None:
    if job.progress is not None:
        progress(Progress(job.progress.stage, job.progress.fraction))


def _error_of(job: JobSeen[OutcomeT]) -> RigwrightError:
    if job.problem is not None:
        return job.problem.error()
    if job.status == "cancelled":
        return CancelledError()
    return InternalError("job-unexplained", f"the job is {job.status}", "see the service's log")
