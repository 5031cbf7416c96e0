from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import counting_job
import pytest
from counting_job import (
    BRIEFLY,
    COUNT,
    MISBEHAVE,
    Counted,
    CountRequest,
    Misbehaved,
    MisbehaveRequest,
)
from service_helpers import HERE, ROOT, alive, ended, files_under, wait_for
from sqlalchemy.exc import OperationalError

from common.errors import CancelledError, ConflictError, InputError, InternalError, TooLargeError
from common.progress import NeverCancelled, Progress, ignore_progress
from service.api.context import STEP_BACK
from service.jobs import writing
from service.jobs.cancels import Cancels
from service.jobs.engine import Task
from service.jobs.manager import JobManager
from service.jobs.notifier import Notifier
from service.jobs.process import ProcessEngine
from service.kinds.base import JobKind, RequestT, ResultT
from service.store import Store
from service.store.jobrecords import NewJob
from service.store.tables import JobStatus

PROGRAM = "counting_job"
ENGINE = ProcessEngine(cancel_grace_s=0.5, program=PROGRAM)


def run(tmp_path: Path, kind: JobKind[RequestT, ResultT], request: RequestT) -> ResultT:
    folder = tmp_path / "files"
    folder.mkdir(exist_ok=True)
    return ENGINE.run(Task(kind, request, folder), ignore_progress, NeverCancelled())


def misbehave(tmp_path: Path, how: str, mark: str = "") -> Misbehaved:
    return run(tmp_path, MISBEHAVE, MisbehaveRequest(how=how, mark=mark))


class TestProcessEngine:
    def test_it_gives_the_result_and_reports_progress(self, tmp_path: Path) -> None:
        heard: list[Progress] = []
        task = Task(COUNT, CountRequest(to=5), tmp_path)
        assert ENGINE.run(task, heard.append, NeverCancelled()).counted == 5
        assert [progress.start for progress in heard] == [-1, 0, 1, 2, 3, 4]
        assert math.isnan(heard[1].cost)  # NaN has no form in JSON, and comes back
        assert (tmp_path / "numbers.txt").read_text().split() == ["0", "1", "2", "3", "4"]

    def test_numerical_libraries_get_one_thread(self, tmp_path: Path) -> None:
        threads = misbehave(tmp_path, "threads").threads
        assert threads
        assert set(threads) == {1}

    def test_it_is_heard_of_before_its_work_is_loaded(self, tmp_path: Path) -> None:
        heard: list[str] = []
        kind = JobKind("nothing", CountRequest, Counted)  # which there is nothing to load for
        with pytest.raises(InternalError, match="no work"):
            ENGINE.run(
                Task(kind, CountRequest(to=1), tmp_path),
                lambda told: heard.append(told.stage),
                NeverCancelled(),
            )
        assert heard == ["loading the program"]

    def test_it_steps_back_for_the_service(self, tmp_path: Path) -> None:
        """Where Linux shares cores out among sessions first, niceness counts within one only."""
        engine = ProcessEngine(step_back=STEP_BACK, program=PROGRAM)
        task = Task(MISBEHAVE, MisbehaveRequest(how="rank"), tmp_path)
        asked = engine.run(task, ignore_progress, NeverCancelled())
        assert asked.rank == (min(os.nice(0) + 10, 19), os.getsid(0))

    def test_it_steps_back_for_nobody_on_the_command_line(self, tmp_path: Path) -> None:
        assert misbehave(tmp_path, "rank").rank == (os.nice(0), os.getsid(0))

    def test_errors_cross_whole(self, tmp_path: Path) -> None:
        with pytest.raises(InputError) as caught:
            misbehave(tmp_path, "refuse")
        assert str(caught.value) == "seven is not a number of cameras; give another"
        assert caught.value.detail == "value"

    @pytest.mark.parametrize(
        ("how", "detail"),
        [
            ("fill", "disk-full"),
            ("raise", "job-crashed"),
            ("segfault", "worker-died"),
            ("die", "worker-died"),
        ],
    )
    def test_a_crash_is_an_internal_error(self, tmp_path: Path, how: str, detail: str) -> None:
        with pytest.raises(InternalError) as caught:
            misbehave(tmp_path, how)
        assert caught.value.detail == detail

    def test_memory_is_limited(self, tmp_path: Path) -> None:
        with pytest.raises(TooLargeError) as caught:
            misbehave(tmp_path, "eat")
        assert caught.value.code == "too-large/memory"

    def test_time_is_limited(self, tmp_path: Path) -> None:
        began = time.monotonic()
        with pytest.raises(TooLargeError) as caught:
            run(tmp_path, BRIEFLY, CountRequest(to=1000))
        assert caught.value.code == "too-large/time"
        assert time.monotonic() - began < 3.0

    def test_what_libraries_print_does_no_harm(self, tmp_path: Path) -> None:
        assert misbehave(tmp_path, "print").how == "print"
        assert files_under(tmp_path) == []

    @pytest.mark.parametrize("deaf", [False, True])
    def test_cancel_acts_within_a_second(self, tmp_path: Path, deaf: bool) -> None:
        cancel, began = threading.Event(), threading.Event()
        asked: list[float] = []

        def ask() -> None:
            began.wait(20.0)
            asked.append(time.monotonic())
            cancel.set()

        thread = threading.Thread(target=ask)
        thread.start()
        task = Task(COUNT, CountRequest(to=10_000, deaf=deaf), tmp_path)
        with pytest.raises(CancelledError):
            ENGINE.run(task, lambda _: began.set(), cancel)
        thread.join()
        assert time.monotonic() - asked[0] < 1.0

    def test_processes_that_the_work_started_end_with_it(self, tmp_path: Path) -> None:
        mark = f"left-behind-{tmp_path.name}"
        misbehave(tmp_path, "spawn", mark)
        wait_for(lambda: not alive(mark), 5.0)

    def test_nothing_outlives_the_process_that_started_it(self, tmp_path: Path) -> None:
        mark = f"orphan-{tmp_path.name}"
        script = (
            f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(HERE)!r}]\n"
            "import counting_job\n"
            "from pathlib import Path\n"
            "from service.jobs.engine import Task\n"
            "from service.jobs.process import ProcessEngine\n"
            "from common.progress import NeverCancelled, Progress, ignore_progress\n"
            "request = counting_job.CountRequest(to=100000)\n"
            f"task = Task(counting_job.COUNT, request, Path({str(tmp_path / mark)!r}))\n"
            "engine = ProcessEngine(program='counting_job')\n"
            "engine.run(task, lambda p: print(p.start, flush=True), NeverCancelled())\n"
        )
        (tmp_path / mark).mkdir()
        parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        assert parent.stdout is not None
        assert parent.stdout.readline().strip() == "-1"  # before its work is loaded
        children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
        assert len(children) == 1
        parent.kill()
        parent.wait()
        parent.stdout.close()
        wait_for(lambda: not Path(f"/proc/{children[0]}").exists(), 3.0)


def manager_of(store: Store, cancels: Cancels, at_once: int) -> JobManager:
    return JobManager(store, ENGINE, counting_job.KINDS, Notifier(), cancels, at_once)


@pytest.fixture
def cancels(store: Store) -> Cancels:
    return Cancels(store, Notifier())


@pytest.fixture
def manager(store: Store, cancels: Cancels) -> Iterator[JobManager]:
    made = manager_of(store, cancels, at_once=2)
    made.start()
    yield made
    made.stop()


def ask(store: Store, manager: JobManager, kind: str, **request: object) -> str:
    job = store.jobs.create(NewJob(kind, request), max_pending=100)
    manager.wake()
    return job.id


class TestJobManager:
    def test_a_job_goes_from_pending_to_completed(self, store: Store, manager: JobManager) -> None:
        job = ended(store, ask(store, manager, "count", to=3))
        assert job.status is JobStatus.COMPLETED
        assert job.result == {"counted": 3, "read": {}}
        assert job.created_at <= (job.started_at or "") <= (job.ended_at or "")
        assert [file.name for file in store.jobs.files(job.id)] == ["numbers.txt"]
        wait_for(lambda: not list((store.folder / "work").iterdir()))

    def test_jobs_run_side_by_side_but_not_more_than_allowed(
        self, store: Store, manager: JobManager
    ) -> None:
        ids = [ask(store, manager, "count", to=60) for _ in range(3)]
        wait_for(lambda: store.jobs.counts().get(JobStatus.RUNNING) == 2)
        assert store.jobs.counts() == {JobStatus.RUNNING: 2, JobStatus.PENDING: 1}
        assert {ended(store, job).status for job in ids} == {JobStatus.COMPLETED}

    def test_a_failed_job_tells_why(self, store: Store, manager: JobManager) -> None:
        job = ended(store, ask(store, manager, "misbehave", how="refuse"))
        assert job.status is JobStatus.FAILED
        assert (job.problem or {})["problem"] == "seven is not a number of cameras"
        assert store.jobs.files(job.id) == []

    def test_a_job_nobody_can_do_fails(self, store: Store, manager: JobManager) -> None:
        job = ended(store, ask(store, manager, "unheard-of"))
        assert (job.problem or {})["detail"] == "job-kind"

    def test_a_driver_survives_whatever_a_job_does(self, store: Store, manager: JobManager) -> None:
        for how in ("segfault", "die", "raise"):
            assert (
                ended(store, ask(store, manager, "misbehave", how=how)).status is JobStatus.FAILED
            )
        assert ended(store, ask(store, manager, "count", to=1)).status is JobStatus.COMPLETED

    def test_cancel_a_running_and_a_pending_job(
        self, store: Store, manager: JobManager, cancels: Cancels
    ) -> None:
        running = [ask(store, manager, "count", to=10_000) for _ in range(2)]
        wait_for(lambda: store.jobs.counts().get(JobStatus.RUNNING) == 2)
        pending = ask(store, manager, "count", to=1)
        assert cancels.cancel(pending, "count").status is JobStatus.CANCELLED
        for job in running:
            wait_for(lambda job=job: store.jobs.get(job).progress)
            assert cancels.cancel(job, "count").cancel_requested
            began = time.monotonic()
            assert ended(store, job).status is JobStatus.CANCELLED
            assert time.monotonic() - began < 1.0
            with pytest.raises(ConflictError) as caught:
                cancels.cancel(job, "count")
            assert caught.value.code == "conflict/job-ended"

    def test_cancel_before_the_work_has_begun(
        self, store: Store, manager: JobManager, cancels: Cancels
    ) -> None:
        for _ in range(5):
            job = ask(store, manager, "count", to=10_000)
            cancels.cancel(job, "count")
            assert ended(store, job).status is JobStatus.CANCELLED

    def test_stopping_interrupts_what_runs_and_leaves_what_waits(
        self, store: Store, cancels: Cancels
    ) -> None:
        manager = manager_of(store, cancels, at_once=1)
        manager.start()
        running = ask(store, manager, "count", to=10_000)
        wait_for(lambda: store.jobs.get(running).progress)
        waiting = ask(store, manager, "count", to=1)
        manager.stop()
        assert store.jobs.get(running).status is JobStatus.INTERRUPTED
        assert store.jobs.get(waiting).status is JobStatus.PENDING
        again = manager_of(store, cancels, at_once=1)
        again.start()
        assert ended(store, waiting).status is JobStatus.COMPLETED
        again.stop()


class TestFullDisk:
    @pytest.fixture(autouse=True)
    def _impatient(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(writing, "RETRY_S", 0.02)

    @staticmethod
    def refusing(write: Callable[..., None], times: int) -> Callable[..., None]:
        left = [times]

        def full(*arguments: object) -> None:
            if left[0]:
                left[0] -= 1
                raise OperationalError("INSERT", {}, Exception("database or disk is full"))
            write(*arguments)

        return full

    def test_a_result_is_kept_once_there_is_room(
        self, store: Store, manager: JobManager, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(store.jobs, "complete", self.refusing(store.jobs.complete, 3))
        job = ended(store, ask(store, manager, "count", to=3))
        assert job.status is JobStatus.COMPLETED
        assert [file.name for file in store.jobs.files(job.id)] == ["numbers.txt"]

    def test_a_failure_is_told_once_there_is_room(
        self, store: Store, manager: JobManager, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(store.jobs, "end", self.refusing(store.jobs.end, 3))
        job = ended(store, ask(store, manager, "misbehave", how="refuse"))
        assert (job.problem or {})["problem"] == "seven is not a number of cameras"

    def test_a_job_is_cancelled_though_that_cannot_be_written(
        self, store: Store, manager: JobManager, cancels: Cancels, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        request = self.refusing(store.jobs.request_cancel, 10**6)
        monkeypatch.setattr(store.jobs, "request_cancel", request)
        monkeypatch.setattr(store.jobs, "end", self.refusing(store.jobs.end, 3))
        job = ask(store, manager, "count", to=10_000)
        wait_for(lambda: store.jobs.get(job).progress)
        assert cancels.cancel(job, "count").cancel_requested
        assert ended(store, job).status is JobStatus.CANCELLED
        with pytest.raises(OperationalError):  # nothing runs here that could be stopped
            cancels.cancel(job, "count")

    def test_progress_that_cannot_be_written_loses_nothing(
        self, store: Store, manager: JobManager, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        record = store.jobs.record_progress
        monkeypatch.setattr(store.jobs, "record_progress", self.refusing(record, 10**6))
        assert ended(store, ask(store, manager, "count", to=5)).status is JobStatus.COMPLETED
