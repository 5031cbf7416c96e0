"""From arming to the last picture: what a capture does to devices. Nothing is written here."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial

from common.errors import (
    CancelledError,
    DeviceError,
    InputError,
    InterlockError,
    RigwrightError,
)
from common.progress import CancelToken, Progress, ProgressCallback
from rig.acquisition.cameras.base import ArmSpec, CameraDevice, CameraSettings
from rig.acquisition.capture.camerathreads import CameraThread, do_all, outcomes
from rig.acquisition.capture.collect import Collected, Collector, Want, read_clock
from rig.acquisition.capture.firing import FATES, CaptureOrder, Fate, Firing, Ready, file_wait_ns
from rig.acquisition.station.pulses import arm_request
from rig.acquisition.station.spec import Interlock, Station
from rig.acquisition.synchrony.faults import Fault, FaultKind
from rig.acquisition.synchrony.fileevidence import FileEvidence
from rig.acquisition.synchrony.fileoutlook import FileOutlook
from rig.acquisition.synchrony.triggertimes import HostInterval
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, FireReport, TriggerBox

WATCH_S = 0.05
BOX_MARGIN_S = 2.0
"""What a box may take beyond its pulses to say what became of them."""


@dataclass
class CaptureRun:
    """One run over open devices. Everything is disarmed on every way out of :meth:`run`.

    ``may_fire`` is called when the box is about to be armed: the last moment at which it is
    certain that nothing has been fired.
    """

    station: Station
    box: TriggerBox | None
    threads: tuple[CameraThread, ...]
    order: CaptureOrder
    progress: ProgressCallback
    cancel: CancelToken
    may_fire: Callable[[], None]
    unopened: Mapping[str, str] = field(default_factory=dict)
    """Cameras of the station that could not be opened, and why."""
    files: FileEvidence | None = None
    """What earlier captures taught of cameras that are only seen through their files."""
    fate: Fate = Fate.NOT_FIRED
    began_ns: int = 0
    """When FIRE was sent, in ns since 1970."""
    _armed: list[str] = field(default_factory=list)
    _give_up: threading.Event = field(default_factory=threading.Event)
    _pictures: int = 0
    _known_s: float | None = None

    def run(self) -> Firing:
        """Arm, fire and collect. :attr:`fate` says what is known of FIRE, also after an error.

        Raises :class:`DeviceError` ``camera-not-ready``, ``trigger-not-fired`` or what the
        devices raise, :class:`InterlockError`, :class:`InputError` ``station-interlock``,
        :class:`CancelledError`.
        """
        self._check_box()
        try:
            ready, faults = self._arm_cameras()
            self._stop_if_cancelled()
            threads = tuple(thread for thread in self.threads if thread.plan.name in ready)
            self.may_fire()
            request = self._arm_box(threads)
            self._stop_if_cancelled()
            return self._fire(threads, ready, request, faults)
        finally:
            self._disarm()

    def rehearse(self) -> tuple[Fault, ...]:
        """All but fire; returns what :meth:`run` would have had to do without.

        Raises what :meth:`run` would raise up to FIRE.
        """
        self._check_box()
        try:
            ready, faults = self._arm_cameras()
            self._stop_if_cancelled()
            self._arm_box(tuple(thread for thread in self.threads if thread.plan.name in ready))
            return faults
        finally:
            self._disarm()

    def _check_box(self) -> None:
        """Refuse early what the box would refuse late."""
        if self.box is None or self.station.trigger is None:
            return
        closed = self.box.health().interlock_closed
        if closed is None and self.station.trigger.interlock is Interlock.REQUIRED:
            raise InputError(
                "station-interlock",
                "the station requires an interlock, and its trigger box has none",
                "use a box that has one, or leave 'interlock' out of [trigger]",
            )
        if closed is False:
            raise InterlockError("open", "the interlock is open", "close it, then try again")

    def _arm_cameras(self) -> tuple[dict[str, Ready], tuple[Fault, ...]]:
        self.progress(Progress("arming cameras", 0.05))
        policy = self.station.policy
        order = self.order
        spec = ArmSpec(order.capture_id, order.shots, policy.frame_deadline_s, order.number)
        jobs = {
            thread.plan.name: thread.do(partial(_arm, settings=thread.plan.settings, spec=spec))
            for thread in self.threads
        }
        ready, late = outcomes(jobs, policy.ready_deadline_s)
        problems = {**self.unopened, **late}
        if problems and not (self.order.allow_partial and ready):
            told = "; ".join(f"{name}: {text}" for name, text in problems.items())
            raise DeviceError(
                "camera-not-ready",
                f"{len(problems)} of {len(self.station.cameras)} cameras are not ready ({told})",
                "see to them, or allow a partial capture",
            )
        faults = tuple(
            Fault(FaultKind.NOT_READY, f"{name} was not ready: {text}", name)
            for name, text in problems.items()
        )
        return ready, faults

    def _arm_box(self, threads: tuple[CameraThread, ...]) -> ArmRequest | None:
        if self.box is None:
            return None
        self.progress(Progress("arming the box", 0.25))
        plans = tuple(thread.plan for thread in threads)
        order = self.order
        request = arm_request(
            self.station, plans, order.box_capture, order.shots, order.interval_us
        )
        if not any(pulse.width_us > 0.0 for pulse in request.pulses.values()):
            # Cameras that are told over their bus, and no light: the box has nothing to do.
            return None
        self._armed.append(order.box_capture)
        self.box.arm(request)
        return request

    def _fire(
        self,
        threads: tuple[CameraThread, ...],
        ready: dict[str, Ready],
        request: ArmRequest | None,
        faults: tuple[Fault, ...],
    ) -> Firing:
        self.progress(Progress("firing", 0.3))
        self._pictures = self.order.shots
        start = threading.Event()
        collectors = {
            thread.plan.name: Collector(thread.device, self._want(thread, ready, start))
            for thread in threads
        }
        jobs = {thread.plan.name: _collect(thread, collectors) for thread in threads}
        self.fate = Fate.UNKNOWN
        before, self.began_ns = time.monotonic_ns(), time.time_ns()
        start.set()
        try:
            with self._abort_when_cancelled():
                problem = self._fire_box(request)
                fired = HostInterval(before, time.monotonic_ns())
                wall = datetime.fromtimestamp(time.time(), UTC).astimezone()
                report = self._await_box(problem, request)
                self._known_s = time.monotonic()
                self.progress(Progress("waiting for pictures", 0.4))
                patience_s = self._last_deadline_s() + BOX_MARGIN_S + _overrun_s(threads)
                collected, problems = outcomes(jobs, patience_s, self._looking(jobs))
        finally:
            # The camera threads must not go on waiting for pictures that nobody will take.
            self._give_up.set()
        self._stop_if_cancelled()
        for name, text in problems.items():
            # What a camera gave before its library hung is as good as any other picture.
            collected[name] = collectors[name].so_far(text)
        absent = tuple(fault.camera for fault in faults if fault.camera is not None)
        return Firing(
            self.order, request, report, fired, wall, threads, ready, collected, absent, faults
        )

    def _looking(self, jobs: Mapping[str, Future[Collected]]) -> Callable[[], bool]:
        """Whether the waiting is to stop; tells meanwhile how many cameras are done."""
        told = 0

        def look() -> bool:
            nonlocal told
            done = sum(job.done() for job in jobs.values())
            if done > told:
                told = done
                share = done / max(len(jobs), 1)
                self.progress(Progress("waiting for pictures", 0.4 + 0.3 * share))
            return self.cancel.is_set()

        return look

    def _want(
        self, thread: CameraThread, ready: Mapping[str, Ready], start: threading.Event
    ) -> Want:
        policy, plan = self.station.policy, thread.plan
        samples = ready[plan.name].clock_samples
        lead = 0.0 if self.station.trigger is None else self.station.trigger.lead_us
        return Want(
            shots=self.order.shots,
            pictures=lambda: self._pictures,
            interval_s=self.order.interval_us / 1e6,
            first_s=(lead + self.station.shutter_delay_us(plan)) / 1e6,
            deadline_s=self._last_deadline_s() - policy.settle_s,
            settle_s=policy.settle_s,
            start=start,
            give_up=self._give_up,
            known_s=lambda: self._known_s,
            patience_s=policy.frame_deadline_s,
            kinds=plan.kinds,
            ready_stamp=max((sample.device_ns for sample in samples), default=None),
            outlook=self._outlook(thread),
        )

    def _outlook(self, thread: CameraThread) -> FileOutlook | None:
        if self.files is None or not thread.device.capabilities.by_files:
            return None
        wait_ns = file_wait_ns(self.station.policy, thread.device.capabilities)
        return self.files.outlook(thread.plan.name, wait_ns, time.time_ns())

    def _fire_box(self, request: ArmRequest | None) -> DeviceError | None:
        """Fire; a lost box is no error yet, because what it did is still to be found out."""
        if self.box is None or request is None:
            return None
        try:
            self.box.fire(request.capture_id)
        except DeviceError as error:
            return error
        except RigwrightError:
            # Refused by the box: nothing was fired.
            self.fate = Fate.NOT_FIRED
            raise
        return None

    def _await_box(
        self, problem: DeviceError | None, request: ArmRequest | None
    ) -> FireReport | None:
        if self.box is None or request is None:
            self.fate = Fate.FIRED
            return None
        report = self.box.wait_done(request.capture_id, self._pulses_s(request) + BOX_MARGIN_S)
        self.fate = FATES[report.outcome]
        if report.outcome is FireOutcome.PARTIAL:
            # Nobody needs to wait for pictures of shots that were not made.
            self._pictures = report.shots_done
        if report.outcome is FireOutcome.NOT_FIRED:
            self._stop_if_cancelled()
            raise problem or DeviceError(
                "trigger-not-fired",
                f"the box did not fire ({report.why or 'it says so'})",
                "see to the box, then take the capture again",
            )
        return report

    def _pulses_s(self, request: ArmRequest) -> float:
        ends = [pulse.delay_us + pulse.width_us for pulse in request.pulses.values()]
        burst = (request.shots - 1) * request.interval_us
        return (request.lead_us + burst + max(ends, default=0.0)) / 1e6

    def _last_deadline_s(self) -> float:
        """From FIRE to the deadline of the last picture."""
        order, trigger = self.order, self.station.trigger
        lead = 0.0 if trigger is None else trigger.lead_us
        delays = [self.station.shutter_delay_us(thread.plan) for thread in self.threads]
        burst = (order.shots - 1) * order.interval_us
        policy = self.station.policy
        return (lead + burst + max(delays)) / 1e6 + policy.frame_deadline_s + policy.settle_s

    def _stop_if_cancelled(self) -> None:
        if self.cancel.is_set():
            raise CancelledError

    @contextlib.contextmanager
    def _abort_when_cancelled(self) -> Iterator[None]:
        """While inside, a cancel takes all outputs low at once and ends the wait for pictures."""
        over = threading.Event()

        def watch() -> None:
            ended = False
            while not ended:
                # Looked at once more at the end: whoever waits may have seen the cancel first.
                ended = over.wait(WATCH_S)
                if self.cancel.is_set():
                    self._give_up.set()
                    if self.box is not None:
                        with contextlib.suppress(RigwrightError):
                            self.box.abort()
                    return

        thread = threading.Thread(target=watch, name="capture-watch", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _disarm(self) -> None:
        if self.box is not None:
            for name in self._armed:
                # A box that is gone disarms itself; the cameras must be disarmed all the same.
                with contextlib.suppress(RigwrightError):
                    self.box.disarm(name)
        do_all(self.threads, lambda device: device.disarm(), self.station.policy.ready_deadline_s)


def _collect(thread: CameraThread, collectors: Mapping[str, Collector]) -> Future[Collected]:
    collector = collectors[thread.plan.name]
    return thread.do(lambda _: collector.run())


def _overrun_s(threads: tuple[CameraThread, ...]) -> float:
    return max((thread.device.capabilities.wait_overrun_s for thread in threads), default=0.0)


def _arm(device: CameraDevice, settings: CameraSettings, spec: ArmSpec) -> Ready:
    had = device.configure(settings)
    device.arm(spec)
    armed = time.monotonic_ns()
    # Read after arming: some cameras set their clocks to zero when acquisition starts.
    return Ready(had, armed, read_clock(device))
