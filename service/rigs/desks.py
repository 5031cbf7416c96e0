"""All stations of the service, and the sessions they photograph into."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from common.errors import ConflictError, InputError, NotFoundError, RigwrightError
from rig.acquisition.capture.results import CaptureResult
from rig.acquisition.session.folder import Session
from rig.acquisition.station.spec import Station
from rig.acquisition.station.stationfile import read_station
from service.rigs.desk import Books, RigDesk
from service.rigs.orders import CAPTURE, RIG_KINDS, capture_document, session_name
from service.store import interrupted
from service.store.jobrecords import JobRecord
from service.store.tables import JobStatus
from service.wire import error_fields


class RigDesks:
    """The desks by name. Raises :class:`InputError` when two stations have one name."""

    def __init__(self, stations: Sequence[Station], sessions: Path, books: Books) -> None:
        self.sessions = sessions
        self._books = books
        self._desks = {station.name: RigDesk(station, sessions, books) for station in stations}
        if len(self._desks) < len(stations):
            raise InputError(
                "station-twice", "two stations have one name", "give each station its own name"
            )

    def start(self) -> None:
        """Settle what a crash left, then open all stations."""
        for job in self._books.store.jobs.running(RIG_KINDS):
            self._settle(job)
        for desk in self._desks.values():
            desk.start()

    def stop(self) -> None:
        """Let go of all devices."""
        for desk in self._desks.values():
            desk.stop()

    def all(self) -> list[RigDesk]:
        """The desks, as the settings list their stations."""
        return list(self._desks.values())

    def get(self, name: str) -> RigDesk:
        """One desk. Raises :class:`NotFoundError`."""
        if name not in self._desks:
            raise NotFoundError(
                "rig",
                f"there is no rig {name!r}",
                "see /v1/rigs; a rig is a station file given to the service with --station",
            )
        return self._desks[name]

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

    def _settle(self, job: JobRecord) -> None:
        """Write down how a job ended that ran when the service died: its session knows."""
        jobs = self._books.store.jobs
        try:
            result = self._committed(job) if job.kind == CAPTURE else None
        except RigwrightError as error:
            jobs.end(job.id, JobStatus.INTERRUPTED, error_fields(error))
            return
        if result is None:
            jobs.end(job.id, JobStatus.INTERRUPTED, error_fields(interrupted()))
        elif result.error is not None:
            jobs.end(job.id, JobStatus.FAILED, error_fields(result.error))
        else:
            jobs.complete(job.id, capture_document(result, session_name(job.request)), {})

    def _committed(self, job: JobRecord) -> CaptureResult | None:
        folder = self.sessions / session_name(job.request)
        try:
            with Session.open(folder) as session:
                record = session.committed(job.request["capture_id"])
        except NotFoundError:
            return None
        except ConflictError as error:
            if error.detail == "session-busy":
                return None
            raise
        return None if record is None else CaptureResult(record, folder, repeated=True)


def read_stations(paths: Sequence[Path]) -> list[Station]:
    """The stations in files. Raises :class:`InputError` for one that makes no sense."""
    return [read_station(path) for path in paths]
