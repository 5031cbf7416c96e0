"""A station in operation: its open box and cameras, and all that can be done with them."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from common.closing import Closing
from common.errors import ConflictError, InputError, RigwrightError
from common.progress import CancelToken, NeverCancelled, Progress, ProgressCallback, ignore_progress
from rig.acquisition.capture.devices import DeviceMaker
from rig.acquisition.capture.filememory import fired_shots, missed, recall
from rig.acquisition.capture.firing import CaptureOrder, Fate, Firing
from rig.acquisition.capture.judging import pair_and_judge
from rig.acquisition.capture.liveview import LiveView
from rig.acquisition.capture.opening import OpenCameras
from rig.acquisition.capture.results import (
    CaptureResult,
    DryRun,
    RigHealth,
    SelfTest,
    SyncCheck,
    judged_lags,
)
from rig.acquisition.capture.rigfacts import (
    RigDesign,
    focal_lengths_mm,
    picture_sizes,
    read_rig_design,
    require_same_rig,
    session_plan,
)
from rig.acquisition.capture.run import CaptureRun
from rig.acquisition.capture.selftest import self_test
from rig.acquisition.session.folder import Session
from rig.acquisition.session.intents import interrupted_intents
from rig.acquisition.session.naming import EitherToken, box_name
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.session.staging import Stage
from rig.acquisition.session.storage import Disk
from rig.acquisition.station.delays import Timing
from rig.acquisition.station.locks import DeviceLocks, device_names
from rig.acquisition.station.pulses import check_burst
from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.boards import station_board
from rig.acquisition.synchrony.capturedata import CaptureData
from rig.acquisition.synchrony.clocks import ClockFitter, fit_clock
from rig.acquisition.synchrony.faults import Fault
from rig.acquisition.synchrony.fileevidence import FileEvidence
from rig.acquisition.synchrony.lags import with_new_timings
from rig.acquisition.synchrony.verdict import Board, Evidence, gather
from rig.acquisition.trigger.box import TriggerBox

NEVER = NeverCancelled()


class Rig(Closing):
    """An open station. All methods may be called from any thread; one thing is done at a time.

    ``maker`` makes its devices; they are owned until :meth:`close`. ``locks``: where lock files
    lie, one place per computer by default. A camera that cannot be opened does not stop the
    others; it is tried again before each capture. Raises :class:`ConflictError` ``device-busy``
    when another process has a device, and :class:`DeviceError` when the box, or every camera,
    is not there.

    :meth:`abort` and :meth:`health` are allowed always; what else is asked for meanwhile, a
    ``live`` picture too, is refused with :class:`ConflictError` ``rig-busy``, which says what it
    is busy with.
    """

    def __init__(
        self,
        station: Station,
        maker: DeviceMaker,
        locks: Path | None = None,
        fit: ClockFitter = fit_clock,
    ) -> None:
        self.station = station
        self.box: TriggerBox | None = None
        self._maker = maker
        self._fit = fit
        self._files = FileEvidence()
        self._turn = threading.Lock()
        self._doing: str | None = None
        self._aborted = threading.Event()
        self._design = read_rig_design(station)
        with contextlib.ExitStack() as opened:
            opened.enter_context(DeviceLocks(device_names(station), locks))
            opened.callback(maker.close)
            if station.trigger is not None:
                self.box = maker.make_box(station.trigger)
                opened.callback(self.box.close)
                self.box.open()
            self._cameras = OpenCameras(station, maker, self.box)
            opened.callback(self._cameras.close)
            self._cameras.require_some()
            self._opened = opened.pop_all()
        self.live = LiveView(self._cameras.by_name, lambda: self._doing)

    def close(self) -> None:
        """Disarm and let go of everything. Closing twice changes nothing."""
        self._opened.close()

    def health(self) -> RigHealth:
        """How everything is; asks nothing of the devices and never waits."""
        box = None if self.box is None else self.box.health()
        able = frozenset(c.name for c in self.station.cameras if self.live.able(c.name))
        return RigHealth(box, self._cameras.health(), self._doing, able)

    @property
    def design(self) -> RigDesign:
        """How it was designed, empty where that is not known."""
        return self._design

    def abort(self) -> None:
        """All outputs low, now, and an end to what is being done; always allowed."""
        self._aborted.set()
        if self.box is not None:
            self.box.abort()

    def reset(self) -> None:
        """Let the box leave its fault; :class:`InterlockError` while its interlock is open."""
        with self._busy_with("a reset"):
            if self.box is not None:
                self.box.reset()

    def new_session(
        self, folder: Path, subject: str = "", operator: str = "", disk: Disk | None = None
    ) -> Session:
        """Begin a session with this rig in a new folder."""
        infos = {
            thread.plan.name: thread.device.info for thread in self._cameras.threads(self.station)
        }
        plan = session_plan(self.station, self._design, infos, subject, operator)
        return Session.create(folder, plan, disk)

    def capture(
        self,
        session: Session,
        capture_id: str,
        *,
        shots: int = 1,
        interval_us: float = 0.0,
        allow_partial: bool | None = None,
        board: Board | None = None,
        progress: ProgressCallback = ignore_progress,
        cancel: CancelToken = NEVER,
    ) -> CaptureResult:
        """Take a capture and commit it to ``session``; the same id again returns what is there.

        ``allow_partial`` None: as the station says. ``board``: how to read the timing board, where
        one stands in the pictures. A capture that lacks pictures is committed as partial, and
        :attr:`CaptureResult.error` says so. Raises :class:`DeviceError`, :class:`InterlockError`,
        :class:`ConflictError` and :class:`CancelledError`; then nothing was committed.
        """
        partial = self.station.policy.allow_partial if allow_partial is None else allow_partial
        check_burst(self.station, shots, interval_us)
        with self._busy_with(f"capture {capture_id}"):
            known = session.committed(capture_id)
            if known is not None:
                return CaptureResult(known, session.folder, repeated=True)
            require_same_rig(session.manifest, self.station, self._design)
            progress(Progress("checking", 0.0))
            session.require_space(self.station.policy.min_free_mb)
            self._recall(session)
            stage = Stage(session, capture_id)
            name = box_name(session.manifest.session_id, capture_id)
            number = session.next_number
            order = CaptureOrder(capture_id, name, shots, interval_us, partial, number)
            run = self._run(order, progress, cancel, stage)
            captured, evidence = self._shoot(run, stage, board or station_board(self.station))
            progress(Progress("writing", 0.8))
            record = self._commit(stage, captured, evidence, partial)
            progress(Progress("committed", 1.0))
            return CaptureResult(record, session.folder)

    def _recall(self, session: Session) -> None:
        """Learn from the session what another run of this rig learned of cameras' files."""
        names = self._by_files()
        if names and not self._files.begun:
            aside = interrupted_intents(session.index)
            recall(self._files, self.station, session.index.records, names, aside)

    def _by_files(self) -> list[str]:
        """The cameras that are only seen through their files."""
        threads = self._cameras.threads(self.station)
        return [t.plan.name for t in threads if t.device.capabilities.by_files]

    def _fire(self, run: CaptureRun) -> Firing:
        """Run it; what it fired in vain is remembered, as its pictures may still come."""
        try:
            return run.run()
        except BaseException:
            if run.fate is not Fate.NOT_FIRED:
                order, at_ns = run.order, run.began_ns
                shots = fired_shots(order.capture_id, at_ns, order.shots, order.interval_us)
                missed(self._files, shots, self._by_files())
            raise

    def _commit(
        self, stage: Stage, captured: CaptureData, evidence: Evidence, partial: bool
    ) -> CaptureRecord:
        try:
            return stage.commit(
                captured,
                evidence,
                self.station.policy,
                partial_allowed=partial,
                focal_mm=focal_lengths_mm(self._design),
            )
        except RigwrightError as error:
            # A passing trouble, or one after the moment that counts, need not lose a capture.
            with contextlib.suppress(RigwrightError):
                record = stage.settle(f"its pictures could not be written: {error.problem}")
                if record is not None:
                    return record
            raise

    def _shoot(
        self, run: CaptureRun, stage: Stage, board: Board | None
    ) -> tuple[CaptureData, Evidence]:
        """Fire and judge; on any error the stage tells what became of the id."""
        try:
            firing = self._fire(run)
            run.progress(Progress("checking pictures", 0.7))
            sizes = picture_sizes(self.station, self._design)
            captured = pair_and_judge(self.station, firing, self._fit, sizes, self._files)
            return captured, gather(self.station, captured, board)
        except BaseException as error:
            # Whatever else goes wrong now, the first error is the one to be told.
            with contextlib.suppress(RigwrightError):
                if run.fate is Fate.NOT_FIRED:
                    stage.drop()
                else:
                    stage.set_aside(run.fate.value, str(error) or type(error).__name__)
            raise

    def dry_run(
        self,
        *,
        shots: int = 1,
        interval_us: float = 0.0,
        allow_partial: bool | None = None,
        progress: ProgressCallback = ignore_progress,
        cancel: CancelToken = NEVER,
    ) -> DryRun:
        """Everything a capture does up to FIRE; raises what a capture would raise."""
        partial = self.station.policy.allow_partial if allow_partial is None else allow_partial
        check_burst(self.station, shots, interval_us)
        with self._busy_with("a dry run"):
            began = time.monotonic()
            order = CaptureOrder("dry-run", box_name("dry-run"), shots, interval_us, partial)
            faults = self._run(order, progress, cancel).rehearse()
            lost = {fault.camera for fault in faults}
            ready = tuple(c.name for c in self.station.cameras if c.name not in lost)
            return DryRun(ready, faults, time.monotonic() - began)

    def self_test(self, folder: Path | None = None) -> SelfTest:
        """Look at box, interlock, clock, cameras and the space in ``folder``; fires nothing."""
        with self._busy_with("a self-test"):
            self._cameras.open_lost()
            threads = self._cameras.threads(self.station)
            return self_test(self.station, self.box, threads, self._cameras.problems, folder)

    def sync_check(
        self,
        captures: int = 3,
        *,
        pause_s: float = 0.5,
        board: Board | None = None,
        progress: ProgressCallback = ignore_progress,
        cancel: CancelToken = NEVER,
    ) -> SyncCheck:
        """Fire several times, file nothing, and say each camera's lag and the delays it asks for.

        ``pause_s`` between captures: the lag of DSLRs is unsteady when they are hurried.
        """
        if captures < 1:
            raise InputError("captures", f"{captures} captures show nothing", "give 1 or more")
        with self._busy_with("a synchronisation check"):
            seen: list[Evidence] = []
            faults: list[Fault] = []
            for k in range(captures):
                progress(Progress(f"capture {k + 1} of {captures}", k / captures))
                if k > 0:
                    self._aborted.wait(pause_s)
                captured, evidence = self._look_once(k + 1, board, cancel)
                seen.append(evidence)
                faults += captured.all_faults
            progress(Progress("done", 1.0))
        return judged_lags(self.station, seen, faults)

    def _look_once(
        self, number: int, board: Board | None, cancel: CancelToken
    ) -> tuple[CaptureData, Evidence]:
        """One capture of which nothing is filed."""
        order = CaptureOrder(f"sync-check-{number}", box_name("sync-check"))
        firing = self._fire(self._run(order, ignore_progress, cancel))
        sizes = picture_sizes(self.station, self._design)
        captured = pair_and_judge(self.station, firing, self._fit, sizes, self._files)
        return captured, gather(self.station, captured, board or station_board(self.station))

    def adopt(self, timings: Mapping[str, Timing]) -> None:
        """Work with new delays from now on; the station file is written by ``write_timings``."""
        self.station = with_new_timings(self.station, timings)

    def _run(
        self,
        order: CaptureOrder,
        progress: ProgressCallback,
        cancel: CancelToken,
        stage: Stage | None = None,
    ) -> CaptureRun:
        self._cameras.open_lost()
        return CaptureRun(
            station=self.station,
            box=self.box,
            threads=self._cameras.threads(self.station),
            order=order,
            progress=progress,
            cancel=EitherToken(cancel, self._aborted),
            may_fire=lambda: (
                None
                if stage is None
                else stage.may_fire(order.box_capture, order.shots, order.interval_us)
            ),
            unopened=dict(self._cameras.problems),
            files=self._files,
        )

    @contextlib.contextmanager
    def _busy_with(self, what: str) -> Iterator[None]:
        if not self._turn.acquire(blocking=False):
            raise ConflictError(
                "rig-busy", f"the rig is busy with {self._doing}", "wait for it, or abort it"
            )
        try:
            self._doing = what
            self._aborted.clear()
            yield
        finally:
            self._doing = None
            self._turn.release()
