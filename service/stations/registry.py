"""All stations of the service, and the sessions they photograph into."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path

from common.errors import ConflictError, InputError, NotFoundError, RigwrightError
from rig.acquisition.capture.results import CaptureResult
from rig.acquisition.session.folder import Session
from rig.acquisition.station.spec import Station
from rig.acquisition.station.stationfile import read_station
from service.ipc import error_fields
from service.kinds.rigs import CAPTURE, RIG_TEST, CaptureRequest
from service.stations.jobs import capture_outcome
from service.stations.removed import RemovedFolder, RemovedSessions
from service.stations.worker import StationWorker, WorkerContext
from service.store import interrupted
from service.store.jobrecords import JobRecord
from service.store.tables import JobStatus

STATION_KINDS = (CAPTURE.name, RIG_TEST.name)
"""Names of the kinds of jobs that stations do."""


class StationRegistry:
    """The workers by name. Raises :class:`InputError` when two stations have one name."""

    def __init__(
        self,
        stations: Sequence[Station],
        sessions: Path,
        context: WorkerContext,
        grace: timedelta = timedelta(days=7),
    ) -> None:
        self.sessions = sessions
        self.removed = RemovedSessions(sessions, grace)
        self._context = context
        self._workers = {
            station.name: StationWorker(station, sessions, context) for station in stations
        }
        if len(self._workers) < len(stations):
            raise InputError(
                "station-twice", "two stations have one name", "give each station its own name"
            )

    def start(self) -> None:
        """Settle what a crash left, then open all stations."""
        for job in self._context.store.jobs.running(STATION_KINDS):
            self._settle(job)
        self.removed.all()
        for worker in self._workers.values():
            worker.start()

    def stop(self) -> None:
        """Let go of all devices."""
        for worker in self._workers.values():
            worker.stop()

    def all(self) -> list[StationWorker]:
        """The workers, as the settings list their stations."""
        return list(self._workers.values())

    def get(self, name: str) -> StationWorker:
        """One worker. Raises :class:`NotFoundError`."""
        if name not in self._workers:
            raise NotFoundError(
                "rig",
                f"there is no rig {name!r}",
                "see /v1/rigs; a rig is a station file given to the service with --station",
            )
        return self._workers[name]

    def session_folder(self, name: str) -> Path:
        """Where a session lies. Raises :class:`NotFoundError` when there is none."""
        for folder in self.session_folders():
            if folder.name == name:
                return folder
        raise NotFoundError("session", f"there is no session {name!r}", "see /v1/sessions")

    def session_folders(self) -> list[Path]:
        """All sessions, by name."""
        if not self.sessions.is_dir():
            return []
        found = (folder for folder in self.sessions.iterdir() if not folder.name.startswith("."))
        return sorted(folder for folder in found if (folder / "session.json").is_file())

    def remove_session(self, name: str) -> RemovedFolder:
        """Put a session away, out of sight of all rigs.

        Raises :class:`NotFoundError`, and :class:`ConflictError` while a rig is busy or somebody
        uses the session.
        """
        folder = self.session_folder(name)
        with ExitStack() as stack:
            for worker in self._workers.values():
                stack.enter_context(worker.without_session(folder))
            if self._context.store.jobs.need_session(str(folder)):
                raise ConflictError(
                    "session-in-use",
                    f"a job that has not ended needs session {name!r}",
                    "wait for it, or cancel it",
                )
            return self.removed.remove(folder)

    def _settle(self, job: JobRecord) -> None:
        """Write down how a job ended that ran when the service died: its session knows."""
        jobs = self._context.store.jobs
        try:
            request = _capture_request(job) if job.kind == CAPTURE.name else None
            result = None if request is None else self._committed(request)
        except RigwrightError as error:
            jobs.end(job.id, JobStatus.INTERRUPTED, error_fields(error))
            return
        if result is None:
            jobs.end(job.id, JobStatus.INTERRUPTED, error_fields(interrupted()))
        elif result.error is not None:
            jobs.end(job.id, JobStatus.FAILED, error_fields(result.error))
        elif request is not None:
            outcome = capture_outcome(result, request.session_name)
            jobs.complete(job.id, CAPTURE.result_row(outcome), {})

    def _committed(self, request: CaptureRequest) -> CaptureResult | None:
        folder = self.sessions / request.session_name
        try:
            with Session.open(folder) as session:
                record = session.committed(request.capture_id)
        except NotFoundError:
            return None
        except ConflictError as error:
            if error.detail == "session-busy":
                return None
            raise
        return None if record is None else CaptureResult(record, folder, repeated=True)


def read_stations(paths: Sequence[Path]) -> list[Station]:
    """The stations in files.

    Raises :class:`InputError` for one that makes no sense, or whose name no address can have.
    """
    stations = [read_station(path) for path in paths]
    for station in stations:
        _require_addressable(station)
    return stations


def _require_addressable(station: Station) -> None:
    # Servers, proxies and browsers take both for a path, however they are written in an address.
    if "/" in station.name or station.name in {".", ".."}:
        raise InputError(
            "station-name",
            f"a station called {station.name!r} has no address in a service: it could be neither "
            "fired nor aborted",
            "give its station file a name without a slash that is not just dots",
        )


def _capture_request(job: JobRecord) -> CaptureRequest:
    asked = {key: value for key, value in job.request.items() if key != "rig"}
    return CaptureRequest.model_validate(asked)
