"""The one thread that owns a port: connects, keeps connected, does orders, listens."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future

from common.errors import DeviceError, RigwrightError
from rig.acquisition.trigger.box import TriggerState
from rig.acquisition.trigger.captures import Captures
from rig.acquisition.trigger.client import RefusedError
from rig.acquisition.trigger.connection import Connection
from rig.acquisition.trigger.jobs import JobQueue, PortJob
from rig.acquisition.trigger.link import NoAnswerError
from rig.acquisition.trigger.serialline import LineLostError, SerialLine

PROBE_S = 8.0
"""How long a box may take from the opening of its port to its first answer: an Uno is reset by
it and stays in its boot loader for a while."""
PROBE_EVERY_S = 0.2
BACKOFF_S = (0.2, 5.0)
"""First and longest pause between attempts to open a port that is gone."""
_HOPELESS_S = 0.9
"""An order that waits for a lost box is given up when it has only this long left."""
_SHORTEST_S = 0.3
_LISTEN_S = 0.25
_UNREACHED, _AGAIN = "the trigger box cannot be reached: ", "; it is looked for again by itself"
_CABLE = "check its cable and power"


class PortOwner:
    """Runs from :meth:`start` to :meth:`stop`.

    ``opened`` gets the first connection's success, or the error that ends the attempt.
    """

    def __init__(
        self,
        connection: Connection,
        captures: Captures,
        queue: JobQueue,
        open_line: Callable[[], SerialLine],
    ) -> None:
        self.opened: Future[None] = Future()
        self._connection = connection
        self._captures = captures
        self._queue = queue
        self._open_line = open_line
        self._line: SerialLine | None = None
        self._met = False
        self._probe_until_ns = 0
        self._backoff_s = BACKOFF_S[0]
        self._remedy = _CABLE
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="trigger box", daemon=True)

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def stop(self, patience_s: float = 3.0) -> None:
        """End the thread and let go of the port."""
        self._closing.set()
        self._queue.wake()
        self._thread.join(patience_s)

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._turn()
        except Exception as error:  # whatever it is, those who wait must hear of it
            self._connection.view.problem = f"internal fault: {error!r}"
            self._fail_opening(error)
            raise
        finally:
            self._drop_line()
            self._queue.close()

    def _turn(self) -> None:
        try:
            if self._line is None:
                self._connect()
            elif not self._met:
                self._probe()
            else:
                self._work()
        except NoAnswerError as error:
            self._doubt(f"the box does not answer ({error})")
        except LineLostError as error:
            self._lose(_gone(f"the line to the box was lost ({error})"))
        except DeviceError as error:
            self._lose(error)

    # -- connection --------------------------------------------------------------------------

    def _connect(self) -> None:
        self._connection.view.state = TriggerState.OPENING
        self._line = self._open_line()
        self._connection.attach(self._line)
        self._probe_until_ns = time.monotonic_ns() + int(PROBE_S * 1e9)

    def _probe(self) -> None:
        began = time.monotonic()
        try:
            self._connection.meet()
            self._connection.view.problem, self._remedy = "", _CABLE
            self._captures.met()
        except (NoAnswerError, RefusedError) as problem:
            if time.monotonic_ns() > self._probe_until_ns:
                why = f"nothing sound is answered within {PROBE_S:g} s ({problem})"
                raise _gone(why) from None
            self._pause(PROBE_EVERY_S - (time.monotonic() - began))
            return
        self._met = True
        self._backoff_s = BACKOFF_S[0]
        if not self.opened.done():
            self.opened.set_result(None)

    def _doubt(self, problem: str) -> None:
        """The port is there, the box silent. It is not closed: opening it would reset an Uno."""
        if self._met:
            self._met = False
            self._connection.metrics.count("reconnects")
            self._connection.view.problem = problem
            self._connection.view.state = TriggerState.PROBING
            self._probe_until_ns = time.monotonic_ns() + int(PROBE_S * 1e9)

    def _lose(self, error: DeviceError) -> None:
        if self._met:
            self._connection.metrics.count("reconnects")
        self._drop_line()
        self._connection.view.problem = error.problem.removeprefix(_UNREACHED)
        self._remedy = error.remedy.removesuffix(_AGAIN)
        if self._fail_opening(error):
            self._closing.set()
            return
        self._pause(self._backoff_s)
        self._backoff_s = min(2.0 * self._backoff_s, BACKOFF_S[1])

    def _fail_opening(self, error: Exception) -> bool:
        if self.opened.done():
            return False
        self.opened.set_exception(error)
        return True

    def _drop_line(self) -> None:
        self._met = False
        self._connection.detach()
        if self._line is not None:
            self._line.close()
            self._line = None

    def _pause(self, seconds: float) -> None:
        """Wait, and meanwhile tell those who wait for the box that it is gone."""
        until = time.monotonic() + seconds
        while not self._closing.is_set():
            problem = self._connection.view.problem or "the box is being looked for"
            self._queue.fail_overdue(_gone(problem, self._remedy), _HOPELESS_S)
            left = until - time.monotonic()
            if left <= 0.0:
                return
            self._closing.wait(min(left, 0.05))

    # -- work --------------------------------------------------------------------------------

    def _work(self) -> None:
        job = self._queue.take()
        if job is not None:
            self._do(job)
        elif not self._housekeep():
            self._listen()
        self._captures.hear()

    def _do(self, job: PortJob) -> None:
        if job.deadline_ns - time.monotonic_ns() < _SHORTEST_S * 1e9:
            job.future.set_exception(_gone("the box was busy for too long"))
            return
        link = self._connection.client.link
        link.deadline_ns = job.deadline_ns - int(0.05e9)
        try:
            job.future.set_result(job.work())
        except RigwrightError as error:
            job.future.set_exception(error)
        except RefusedError as refused:
            job.future.set_exception(_gone(str(refused)))
        except (NoAnswerError, LineLostError) as error:
            job.future.set_exception(_gone(f"no answer to {error}"))
            raise
        except Exception as error:
            job.future.set_exception(error)
            raise
        finally:
            link.deadline_ns = None

    def _housekeep(self) -> bool:
        """Do one thing that is due; whether there was one."""
        now = time.monotonic_ns()
        connection, captures = self._connection, self._captures
        try:
            if connection.boot_doubted:
                if connection.check_boot():
                    captures.met()
            elif connection.fetch_missing():
                return True
            elif captures.resolve_due_ns is not None and captures.resolve_due_ns <= now:
                captures.resolve()
            elif connection.status_due_ns <= now:
                connection.look()
                connection.fit()
            elif self._may_sample() and connection.sample_due_ns <= now:
                connection.sample()
            else:
                return False
        except RefusedError as refused:
            raise NoAnswerError(str(refused)) from refused
        return True

    def _may_sample(self) -> bool:
        return self._connection.view.state is not TriggerState.FIRING

    def _listen(self) -> None:
        due = [self._connection.status_due_ns]
        if self._may_sample():
            due.append(self._connection.sample_due_ns)
        if self._captures.resolve_due_ns is not None:
            due.append(self._captures.resolve_due_ns)
        patience_s = (min(due) - time.monotonic_ns()) / 1e9
        self._connection.client.link.listen(min(max(patience_s, 0.0), _LISTEN_S))


def _gone(problem: str, remedy: str = _CABLE) -> DeviceError:
    return DeviceError("trigger-gone", f"{_UNREACHED}{problem}", f"{remedy}{_AGAIN}")
