"""Who does what a command wants of a rig: the service that owns it, or this process.

A rig has one owner. Where a service runs it, the command asks there, and says so in one line.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from threading import Event
from typing import Protocol
from urllib.parse import quote

from common.errors import InputError, InternalError, NotFoundError, RigwrightError
from common.files.writing import writable_place
from common.progress import ProgressCallback
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.folder import Session, session_folder
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.station.delays import write_timings
from rig.acquisition.station.stationfile import read_station
from rig.devices.station import open_station
from service.client.asking import Service
from service.client.notes import FoundService, find_service
from service.client.rig import RigSeen, RigsSeen, ServedRig
from service.kinds.rigs import CaptureRequest, RigTestOutcome, RigTestRequest
from service.stations.jobs import dry_run_outcome, self_test_outcome, sync_outcome
from service.stations.status import camera_statuses, rig_state, trigger_status

SESSIONS = Path("sessions")


@dataclass(frozen=True)
class Asked:
    """Which rig a command is about, as its options say it."""

    station: Path | None
    server: str | None = None
    key: str | None = None
    rig: str | None = None


@dataclass(frozen=True)
class Taken:
    """A capture that is filed in ``session``. ``error``: what to end with where it is not whole."""

    record: CaptureRecord
    session: str
    pictures: list[str]
    error: RigwrightError | None


class RigToAsk(Protocol):
    """A rig, whoever owns it."""

    def file_in(self, folder: Path | None, request: CaptureRequest) -> None:
        """Where captures are filed; a new session of its subject where ``folder`` is None."""
        ...

    def capture(self, request: CaptureRequest, progress: ProgressCallback, cancel: Event) -> Taken:
        """Take a capture and file it. Raises what kept it from being taken."""
        ...

    def status(self) -> RigSeen:
        """How the rig and its devices are."""
        ...

    def test(
        self, request: RigTestRequest, progress: ProgressCallback, cancel: Event
    ) -> RigTestOutcome:
        """Test the rig; a test that is to ``adopt`` delays writes them to the station file."""
        ...


@contextmanager
def rig_to_ask(asked: Asked) -> Iterator[RigToAsk]:
    """The rig, to be asked as long as the block lasts."""
    with served_rig(asked) as served:
        if served is not None:
            yield served
            return
    with ExitStack() as stack:
        rig = stack.enter_context(open_station(read_station(_station(asked))))
        yield OwnRig(rig, stack)


@contextmanager
def served_rig(asked: Asked) -> Iterator[RigThere | None]:
    """The rig where a service runs it, told in one line on standard error; None where none does."""
    found = None if asked.server else find_service(_station(asked))
    if not asked.server and found is None:
        yield None
        return
    key = asked.key if found is None or found.own else None
    certificate = found.note.certificate if found else None
    service = Service(found.note.url if found else asked.server or "", key, certificate)
    try:
        name = found.note.rig if found else _name(service, asked)
        sys.stderr.write(f"asking the service at {service.url}, which runs the rig {name!r}\n")
        yield RigThere(ServedRig(service, name), found, service.url)
    except InputError as error:
        if found is None or found.own or error.detail != "key-needed":
            raise
        # Whoever could write the note would be given the key.
        raise InputError(
            error.detail,
            f"the service at {service.url} wants a key, and is another user's",
            f"say --server {service.url}, with the key in RIGWRIGHT_KEY",
        ) from None
    finally:
        service.close()


def _station(asked: Asked) -> Path:
    if asked.station is None:
        raise InputError("station", "no rig is named", "give --station, or --server")
    return asked.station


def _name(service: Service, asked: Asked) -> str:
    if asked.rig is not None:
        return asked.rig
    if asked.station is not None:
        return read_station(asked.station).name
    names = [rig.name for rig in service.read("rigs", RigsSeen).items]
    if len(names) == 1:
        return names[0]
    raise InputError(
        "rig",
        f"the service has {len(names)} rigs" + (f": {', '.join(names)}" if names else ""),
        "name one with --rig" if names else "start it with --station",
    )


class OwnRig:
    """A rig whose devices this process has; what is opened beside it is closed with ``stack``."""

    def __init__(self, rig: Rig, stack: ExitStack) -> None:
        self._rig = rig
        self._stack = stack
        self._session: Session | None = None

    def file_in(self, folder: Path | None, request: CaptureRequest) -> None:
        """See :class:`RigToAsk`."""
        self._session = self._stack.enter_context(self._opened(folder, request))

    def _opened(self, folder: Path | None, request: CaptureRequest) -> Session:
        subject, operator = request.subject, request.operator
        if folder is None:
            return self._rig.new_session(session_folder(SESSIONS, subject), subject, operator)
        try:
            return Session.open(folder)
        except NotFoundError:
            if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
                raise
            return self._rig.new_session(folder, subject, operator)

    def status(self) -> RigSeen:
        """See :class:`RigToAsk`."""
        health, station = self._rig.health(), self._rig.station
        return RigSeen(
            name=station.name,
            status=rig_state(health, busy=False, problem=None),
            doing=None,
            problem=None,
            trigger=trigger_status(health),
            cameras=camera_statuses(station, health),
        )

    def capture(self, request: CaptureRequest, progress: ProgressCallback, cancel: Event) -> Taken:
        """See :class:`RigToAsk`."""
        if self._session is None:
            raise InternalError("no-session", "nobody said where to file", "call file_in first")
        done = self._rig.capture(
            self._session,
            request.capture_id,
            shots=request.shots,
            interval_us=request.interval_us,
            allow_partial=request.allow_partial,
            progress=progress,
            cancel=cancel,
        )
        pictures = [str(done.folder / frame.file.path) for frame in done.record.frames]
        return Taken(done.record, str(done.folder), pictures, done.error)

    def test(
        self, request: RigTestRequest, progress: ProgressCallback, cancel: Event
    ) -> RigTestOutcome:
        """See :class:`RigToAsk`."""
        if request.test == "self-test":
            return self_test_outcome(self._rig.self_test())
        if request.test == "dry-run":
            return dry_run_outcome(
                self._rig.dry_run(
                    shots=request.shots,
                    interval_us=request.interval_us,
                    allow_partial=request.allow_partial,
                    progress=progress,
                    cancel=cancel,
                )
            )
        path = self._rig.station.path
        if request.adopt and path is not None:
            writable_place(path, overwrite=True)
        measured = self._rig.sync_check(request.captures, progress=progress, cancel=cancel)
        adopted = request.adopt and measured.timings is not None and path is not None
        if adopted and measured.timings is not None and path is not None:
            write_timings(path, measured.timings)
        return sync_outcome(measured, adopted=adopted)


class RigThere:
    """A rig that a service owns; ``found``: how it was found, None where it was named."""

    def __init__(self, rig: ServedRig, found: FoundService | None, url: str) -> None:
        self.rig = rig
        self._found = found
        self._url = url
        self._session = ""

    def file_in(self, folder: Path | None, request: CaptureRequest) -> None:
        """See :class:`RigToAsk`. The service files in its own folder, under the last part."""
        if folder is None:
            letters = re.sub(r"[^A-Za-z0-9]", "", request.subject)[:32] or "unnamed"
            self._session = f"sub-{letters}.ses-{datetime.now():%Y%m%dT%H%M%S}"
        else:
            self._session = folder.resolve().name
        if folder is not None and str(folder.resolve()) != self._place():
            sys.stderr.write(f"it files in {self._place()}\n")

    def _place(self, path: str = "") -> str:
        if self._found is not None:
            return str(Path(self._found.note.sessions).resolve() / self._session / path)
        own = f"{self._url}/v1/sessions/{quote(self._session)}"
        return f"{own}/files/{quote(path)}" if path else own

    def status(self) -> RigSeen:
        """See :class:`RigToAsk`."""
        return self.rig.status()

    def capture(self, request: CaptureRequest, progress: ProgressCallback, cancel: Event) -> Taken:
        """See :class:`RigToAsk`."""
        if self._session:
            request = CaptureRequest.model_validate(
                {**request.model_dump(), "session": self._session}
            )
        record, error = self.rig.capture(request, progress, cancel)
        pictures = [self._place(frame.file.path) for frame in record.frames]
        return Taken(record, self._place(), pictures, error)

    def test(
        self, request: RigTestRequest, progress: ProgressCallback, cancel: Event
    ) -> RigTestOutcome:
        """See :class:`RigToAsk`."""
        return self.rig.test(request, progress, cancel)
