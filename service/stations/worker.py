"""One station of the service: its devices belong to one thread, which does one thing at a time."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from common.errors import (
    ConflictError,
    DeviceError,
    InterlockError,
    InternalError,
    NotFoundError,
    RigwrightError,
)
from common.files.plain import plain
from common.progress import Progress, ProgressCallback
from rig.acquisition.capture.results import RigHealth
from rig.acquisition.capture.rig import Rig
from rig.acquisition.station.spec import Station
from rig.acquisition.trigger.box import TriggerCapabilities, TriggerState
from rig.devices.station import open_station
from service import logs
from service.jobs.cancels import Cancels
from service.jobs.engine import Running
from service.jobs.manager import end_without_result
from service.jobs.notifier import Notifier
from service.jobs.writing import write_at_last
from service.kinds.base import JobKind, Request, Result
from service.kinds.rigs import RIG_TEST
from service.stations.sessions import Sessions
from service.store import Store
from service.store.jobrecords import JobRecord, NewJob


@dataclass(frozen=True)
class StationWork:
    """A job that waits for its rig: its kind, and what it does with the open rig."""

    kind: JobKind[Any, Any]
    do: Callable[[Rig, Sessions, Running], Result]


_REOPEN_S = 5.0
"""How often devices are looked for that were not there: somebody plugs them in sooner or later."""

_LAST_MOMENT_S = 1.0
"""How long a thread may take to be done with a job whose end can be read already."""

_GONE = (TriggerState.DISCONNECTED, TriggerState.OPENING, TriggerState.PROBING)


@dataclass(frozen=True)
class WorkerContext:
    """What a worker writes into: shared by all workers of a service."""

    store: Store
    notifier: Notifier
    cancels: Cancels


class StationWorker:
    """A station, open as long as the service runs.

    Jobs are begun by request threads and done by the worker's own thread; a second one meanwhile
    is refused, because a capture that waits in a queue is not what its subject sat still for.
    """

    def __init__(self, station: Station, sessions: Path, context: WorkerContext) -> None:
        self.station = station
        self._context = context
        self._sessions = Sessions(sessions)
        self._lock = threading.Lock()
        self._waiting: queue.SimpleQueue[tuple[JobRecord, StationWork] | None] = queue.SimpleQueue()
        self._rig: Rig | None = None
        self._problem: RigwrightError | None = None
        self._doing: JobRecord | None = None
        self._asked_by = ""
        self._aborts = 0
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=f"rig-{station.name}", daemon=True)

    @property
    def name(self) -> str:
        """The station's name."""
        return self.station.name

    def start(self) -> None:
        """Open the devices and begin to take orders."""
        self._thread.start()

    def stop(self) -> None:
        """End what is being done and let go of the devices."""
        with self._lock:
            self._stopping.set()
        self._context.cancels.stop_all()
        self._waiting.put(None)
        if self._thread.is_alive():
            self._thread.join()

    def health(self) -> tuple[RigHealth | None, RigwrightError | None, JobRecord | None]:
        """How the devices are (None: not open), why they are not open, and what is being done."""
        rig = self._rig
        return (None if rig is None else rig.health()), self._problem, self._doing

    @property
    def asked_by(self) -> str:
        """Who asked for what is being done; empty where nothing is, or nobody said."""
        return "" if self._doing is None else self._asked_by

    @property
    def aborts(self) -> int:
        """How often somebody aborted since the service began."""
        return self._aborts

    def box_abilities(self) -> TriggerCapabilities | None:
        """What the trigger box can do; None where there is none or it is not open."""
        rig = self._rig
        return None if rig is None or rig.box is None else rig.box.capabilities

    def open_rig(self, camera: str) -> Rig:
        """The open rig, to look through one of its cameras.

        Raises :class:`NotFoundError` for a camera that the station does not name.
        """
        if camera not in {plan.name for plan in self.station.cameras}:
            raise NotFoundError(
                "camera",
                f"rig {self.name!r} has no camera {camera!r}",
                f"choose one of {', '.join(plan.name for plan in self.station.cameras)}",
            )
        rig = self._rig
        if rig is None:
            raise self._not_open()
        return rig

    def abort(self) -> None:
        """All outputs low, now; what is being done ends. Allowed always, waits for nobody."""
        rig, doing = self._rig, self._doing
        self._aborts += 1  # without the lock, which others hold while they write to disk
        if rig is None:
            raise self._not_open()
        try:
            rig.abort()
        finally:
            if doing is not None:
                # Whoever reads the job must see that somebody ended it.
                with suppress(ConflictError):
                    self._context.cancels.cancel(doing.id, doing.kind)

    def reset(self) -> None:
        """Let the box leave its fault.

        Raises :class:`InterlockError` while its interlock is open, :class:`ConflictError` while
        the rig is busy.
        """
        rig = self._rig
        if rig is None:
            raise self._not_open()
        rig.reset()

    def begin(
        self, request: Request, job_id: str, work: StationWork, asked_by: str = ""
    ) -> tuple[JobRecord, bool]:
        """Begin a job, and whether it is new; the same request again gives the job there is.

        ``asked_by``: the name of who asks, told to whoever is refused meanwhile.
        Raises :class:`ConflictError` ``rig-busy`` and ``id-used``, :class:`DeviceError` when box
        or cameras are not there, :class:`InterlockError` when the interlock is open.
        """
        new = NewJob(work.kind.name, {"rig": self.name} | request.model_dump(mode="json"))
        with self._lock:
            known = self._context.store.jobs.find(job_id)
            if known is None:
                self._require_ready(work.kind)
            record, fresh = self._context.store.jobs.begin(new, job_id)
            if fresh:
                self._doing, self._asked_by = record, asked_by
                self._waiting.put((record, work))
            return record, fresh

    @contextmanager
    def without_session(self, folder: Path) -> Iterator[None]:
        """Nothing is begun meanwhile, and the session is closed here.

        Raises :class:`ConflictError` ``rig-busy`` while something is being done.
        """
        until_s = time.monotonic() + _LAST_MOMENT_S
        doing = self._doing
        while doing is not None and self._over(doing) and time.monotonic() < until_s:
            time.sleep(0.01)
            doing = self._doing
        with self._lock:
            if self._doing is not None:
                raise self._busy(self._doing)
            self._sessions.let_go_of(folder)
            yield

    def _require_ready(self, kind: JobKind[Any, Any]) -> None:
        if self._doing is not None and not self._over(self._doing):
            raise self._busy(self._doing)
        if self._rig is None or self._stopping.is_set():
            raise self._not_open()
        box = self._rig.health().box
        if box is None or kind is RIG_TEST:
            return
        if box.state in _GONE:
            raise DeviceError(
                "trigger-gone",
                f"the trigger box of rig {self.name!r} does not answer "
                f"({box.last_problem or box.state.value})",
                "check its cable and power; it is looked for again and again",
            )
        if box.interlock_closed is False:
            raise InterlockError(
                "open", f"the interlock of rig {self.name!r} is open", "close it, then ask again"
            )

    def _busy(self, doing: JobRecord) -> ConflictError:
        who = f", asked for by {self._asked_by!r}" if self._asked_by else ""
        return ConflictError(
            "rig-busy",
            f"rig {self.name!r} is busy with {doing.kind} {doing.id}{who}",
            "wait until it has ended, or abort it",
        )

    def _over(self, job: JobRecord) -> bool:
        """Whether a job's end can be read already, though its thread is not quite done with it.

        Whoever reads it asks for the next at once, and must not be told that the rig is busy.
        """
        return self._context.store.jobs.get(job.id).status.terminal

    def _not_open(self) -> RigwrightError:
        # What stood in the way may be gone: ask the thread to try once more.
        self._waiting.put(None)
        return self._problem or DeviceError(
            "rig-opening", f"rig {self.name!r} is being opened", "ask again in a few seconds"
        )

    def _serve(self) -> None:
        self._try_to_open()
        while True:
            order = self._next_job()
            if order is not None:
                self._do(*order)
            elif self._stopping.is_set():
                break
            elif self._rig is None:
                self._try_to_open()
        self._sessions.close()
        if self._rig is not None:
            self._rig.close()

    def _next_job(self) -> tuple[JobRecord, StationWork] | None:
        """What is asked for next; None now and then while the rig is not open."""
        try:
            return self._waiting.get(timeout=_REOPEN_S if self._rig is None else None)
        except queue.Empty:
            return None

    def _try_to_open(self) -> None:
        try:
            self._rig = open_station(self.station)
            self._problem = None
            logs.log.info("rig open", extra={"fields": {"rig": self.name}})
        except RigwrightError as error:
            self._problem = error
            logs.log.warning(
                "rig not open", extra={"fields": {"rig": self.name, "why": str(error)}}
            )

    def _do(self, job: JobRecord, work: StationWork) -> None:
        token = logs.job_id.set(job.id)
        jobs = self._context.store.jobs
        try:
            if self._rig is None:
                raise self._not_open()
            with self._context.cancels.running(job.id) as cancel:
                running = Running(self._reporter(job.id), cancel)
                row = work.kind.result_row(work.do(self._rig, self._sessions, running))
            self._write(lambda: jobs.complete(job.id, row, {}))
        except RigwrightError as error:
            self._end(job, error)
        except Exception as error:  # noqa: BLE001 - the rig must go on being usable
            logs.log.exception("a job of a rig could not be done")
            self._end(job, InternalError("rig-fault", f"a fault ({error!r})", "see the log"))
        finally:
            with self._lock:
                # The next may have been taken on since this one's end could be read.
                if self._doing is job:
                    self._doing = None
            self._context.notifier.notify(job.id)
            logs.job_id.reset(token)

    def _end(self, job: JobRecord, error: RigwrightError) -> None:
        context = self._context
        self._write(lambda: end_without_result(context.store, context.cancels, job.id, error))

    def _write(self, write: Callable[[], None]) -> None:
        # Where it cannot be written before the service ends, the next start settles the job.
        with suppress(SQLAlchemyError):
            write_at_last(write, self._stopping)

    def _reporter(self, job_id: str) -> ProgressCallback:
        def report(progress: Progress, /) -> None:
            # How far a job is may go unwritten; what comes of it may not.
            with suppress(SQLAlchemyError):
                self._context.store.jobs.record_progress(job_id, plain(progress))
            self._context.notifier.notify(job_id)

        return report
