"""Stopped at every single step of writing: nothing committed is lost, nothing half is whole."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from faultydisk import FaultyDisk, PowerCut
from memorybench import Bench, BenchMaker
from memoryrig import memory_station, with_policy

from common.errors import ConflictError, InputError, NotFoundError, RigwrightError
from rig.acquisition.session import paths
from rig.acquisition.session.folder import Session, SessionPlan, session_folder
from rig.acquisition.session.recovery import Recovery
from rig.acquisition.session.storage import Disk
from rig.acquisition.session.verify import verify_session

QUICK = with_policy(memory_station(2), settle_s=0.0)


def operations_of_a_capture(bench: BenchMaker) -> int:
    disk = FaultyDisk()
    made = bench(QUICK, disk=disk)
    made.rig.capture(made.session, "one")
    before = disk.operations
    made.rig.capture(made.session, "two")
    made.session.close()
    made.rig.close()
    return disk.operations - before


def stopped_at(made: Bench, disk: FaultyDisk, step: int) -> BaseException | None:
    """A second capture that the disk stops at that step; None when it went on all the same."""
    disk.fail_at, disk.failed = disk.operations + step, False
    try:
        made.rig.capture(made.session, "two")
    except (PowerCut, RigwrightError) as stopped:
        return stopped
    finally:
        disk.fail_at = None
    return None


def after_a_stop(made: Bench) -> tuple[Session, int]:
    """What a new process finds: opens, recovers, verifies; returns the session and its captures."""
    made.session.close()
    session = Session.open(made.session.folder)
    made.session = session
    check = verify_session(session.folder)
    assert check.whole, check.findings
    assert not (session.folder / paths.INCOMPLETE).exists()
    ids = [record.capture_id for record in session.index.records]
    assert ids[0] == "one"
    return session, len(ids)


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> int:
    maker = BenchMaker(tmp_path_factory.mktemp("count"))
    count = operations_of_a_capture(maker)
    assert count > 40
    return count


@pytest.mark.slow
def test_a_power_cut_at_every_step(bench: BenchMaker, steps: int) -> None:
    """One rig, one session per step: the second capture is cut short at that step."""
    fates = set()
    disk = FaultyDisk()
    made = bench(QUICK, disk=disk)
    made.rig.capture(made.session, "one")
    master = made.session.folder
    for step in range(steps):
        made.session.close()
        folder = master.with_name(f"cut{step}")
        shutil.copytree(master, folder)
        made.session = Session.open(folder, disk)
        stopped = stopped_at(made, disk, step)
        if not disk.failed:
            # Two writers need a step more or less, depending on which makes a folder first.
            assert step > steps - 5
            break
        assert isinstance(stopped, PowerCut)
        fired = len(made.box.fired)
        session, captures = after_a_stop(made)
        if captures == 2:
            fates.add("committed")
            assert made.rig.capture(session, "two").repeated
            assert len(made.box.fired) == fired
        elif session.manifest.interrupted:
            fates.add("unknown")
            with pytest.raises(ConflictError, match="interrupted"):
                made.rig.capture(session, "two")
        else:
            fates.add("never begun")
            assert made.rig.capture(session, "two").record.number == 2
        assert made.rig.capture(session, "three").record.state == "complete"
        assert verify_session(folder).whole
        session.close()
    assert fates == {"never begun", "unknown", "committed"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code"),
    [
        (errno.ENOSPC, "conflict/disk-full"),
        (errno.EROFS, "input/session-unwritable"),
        (errno.EIO, "conflict/disk-error"),
    ],
)
def test_a_disk_that_fails_at_any_step_is_named(
    bench: BenchMaker, steps: int, number: int, code: str
) -> None:
    disk = FaultyDisk(error=OSError(number, os.strerror(number)))
    made = bench(QUICK, disk=disk)
    made.rig.capture(made.session, "one")
    master = made.session.folder
    passed = 0
    for step in range(0, steps, 5 if number != errno.ENOSPC else 3):
        made.session.close()
        folder = master.with_name(f"full{number}-{step}")
        shutil.copytree(master, folder)
        made.session = Session.open(folder, disk)
        disk.for_good = step % 2 == 0
        error = stopped_at(made, disk, step)
        if not disk.failed:
            assert step > steps - 5
            break
        session, captures = after_a_stop(made)
        if error is None:
            assert captures == 2 and not disk.for_good, "a passing trouble was got over"
            passed += 1
        else:
            assert isinstance(error, RigwrightError) and error.code == code, error
            assert str(folder) in str(error)
        assert made.rig.capture(session, "three").record.state == "complete"
        session.close()
    assert passed > 0


def test_the_same_process_goes_on_after_a_full_disk(bench: BenchMaker, steps: int) -> None:
    """Space is freed; the next capture brings the session in order by itself."""
    disk = FaultyDisk(error=OSError(errno.ENOSPC, ""))
    made = bench(QUICK, disk=disk)
    made.rig.capture(made.session, "one")
    for number, step in enumerate((steps // 3, steps // 2, 4 * steps // 5)):
        disk.fail_at = disk.operations + step
        with pytest.raises(ConflictError, match="no space left"):
            made.rig.capture(made.session, f"full{number}")
        disk.fail_at = None
        made.rig.capture(made.session, f"next{number}")
        assert verify_session(made.session.folder).whole


def test_a_slow_disk_loses_nothing(bench: BenchMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.acquisition.session.staging.SLOW_S", 0.05)
    made = bench(QUICK, disk=FaultyDisk(delay_s=0.05))
    record = made.rig.capture(made.session, "slow").record
    assert record.state == "complete"
    assert [fault.kind for fault in record.faults] == ["slow-disk"]
    assert verify_session(made.session.folder).whole


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A real file system of 1 MB, where this user may mount one."""
    place = tmp_path / "tiny"
    place.mkdir()
    if os.geteuid() != 0 or os.system(f"mount -t tmpfs -o size=1m tmpfs {place} 2>/dev/null"):  # noqa: S605
        pytest.skip("no file system can be mounted here")
    yield place
    os.system(f"umount -l {place}")  # noqa: S605


def test_a_file_system_that_is_really_full(bench: BenchMaker, tiny_disk: Path) -> None:
    made = bench(QUICK)
    made.session.close()
    made.session = made.rig.new_session(tiny_disk / "session")
    taken = 0
    with pytest.raises(ConflictError, match="no space left") as full:
        for taken in range(400):
            made.rig.capture(made.session, f"c{taken}")
    assert full.value.code == "conflict/disk-full" and taken > 3
    made.session.close()
    os.system(f"mount -o remount,size=4m {tiny_disk}")  # noqa: S605
    session = Session.open(made.session.folder)
    made.session = session
    assert verify_session(session.folder).whole
    assert len(session.index.records) in (taken, taken + 1)
    assert made.rig.capture(session, "after").record.state == "complete"
    session.close()


def test_opening_an_interrupted_session_brings_it_in_order_once(
    bench: BenchMaker, steps: int
) -> None:
    disk = FaultyDisk()
    made = bench(QUICK, disk=disk)
    made.rig.capture(made.session, "one")
    stopped_at(made, disk, steps // 2)
    with pytest.raises(ConflictError, match="another process works on the session"):
        Session.open(made.session.folder)
    made.session.close()
    found = verify_session(made.session.folder)
    assert "interrupted" in {finding.kind.value for finding in found.findings}
    with Session.open(made.session.folder) as session:
        assert session.recovery.committed or session.recovery.set_aside
    with Session.open(made.session.folder) as session:
        assert session.recovery == Recovery()
    assert verify_session(made.session.folder).whole


def test_a_staged_capture_with_a_damaged_picture_is_put_aside(
    bench: BenchMaker, steps: int
) -> None:
    """Rolled forward only when every byte is right."""
    disk = FaultyDisk()
    made = bench(QUICK, disk=disk)
    made.rig.capture(made.session, "one")
    folder = made.session.folder
    before = shutil.copytree(folder, folder.with_name("before"))
    for step in range(steps):
        stage = paths.stage(folder, "two")
        stopped_at(made, disk, step)
        pictures = list(stage.rglob("*.jpg"))
        if (stage / paths.STAGED_RECORD).exists() and len(pictures) == 2:
            break
        made.session.close()
        # A picture that was late on a busy machine lets a try get further than the next one.
        shutil.rmtree(folder)
        shutil.copytree(before, folder)
        made.session = Session.open(folder, disk)
    pictures[0].write_bytes(pictures[0].read_bytes()[:-1])
    made.session.close()
    session = Session.open(made.session.folder)
    assert session.recovery.set_aside == ("two",)
    assert [record.capture_id for record in session.index.records] == ["one"]
    assert verify_session(session.folder).whole
    session.close()


def test_a_beginning_that_a_crash_left_is_removed(tmp_path: Path) -> None:
    plan = SessionPlan("memory", "0" * 64, {"rig/rig.json": b"{}"})
    for step in range(200):
        disk = FaultyDisk(step)
        try:
            Session.create(tmp_path / "ses", plan, disk).close()
        except PowerCut:
            assert not (tmp_path / "ses").exists() or verify_session(tmp_path / "ses").whole
        else:
            break
        if (tmp_path / "ses").exists():
            shutil.rmtree(tmp_path / "ses")
    assert step > 10
    assert verify_session(tmp_path / "ses").whole
    assert [path.name for path in tmp_path.iterdir()] == ["ses"]


def test_a_session_that_is_there_is_not_begun_again(tmp_path: Path) -> None:
    plan = SessionPlan("memory", "0" * 64)
    with Session.create(tmp_path / "ses", plan) as session:
        with pytest.raises(ConflictError, match="is there already"):
            Session.create(tmp_path / "ses", plan)
        with pytest.raises(ConflictError, match="another process"):
            Session.open(tmp_path / "ses")
        assert session.next_number == session.next_instant == 1
    Session.open(tmp_path / "ses").close()


def test_what_is_no_session(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(NotFoundError, match="is not a session"):
            Session.open(folder)
        with pytest.raises(NotFoundError, match="is not a session"):
            verify_session(folder)


def test_a_damaged_session_is_refused_not_mended(bench: BenchMaker) -> None:
    made = bench(QUICK)
    made.rig.capture(made.session, "one")
    made.session.close()
    path = made.session.folder / "session.json"
    document = json.loads(path.read_text())
    path.write_text(json.dumps({**document, "subject": "somebody else"}))
    with pytest.raises(InputError, match="its digest does not fit"):
        Session.open(made.session.folder)
    path.write_text("{")
    with pytest.raises(InputError, match=r"session\.json is not JSON"):
        Session.open(made.session.folder)
    path.write_text(json.dumps({**document, "sujbect": "x"}))
    with pytest.raises(InputError, match="did you mean subject"):
        Session.open(made.session.folder)
    path.write_text(json.dumps(document))
    record = next((made.session.folder / "captures").iterdir())
    record.write_bytes(record.read_bytes() + b" ")
    with pytest.raises(InputError, match="is not as it was written"):
        Session.open(made.session.folder)


def test_a_read_only_folder_is_named(tmp_path: Path) -> None:
    class ReadOnly(Disk):
        def write(self, path: Path, data: bytes) -> None:  # noqa: ARG002
            raise PermissionError(errno.EACCES, "Permission denied", str(path))

    with pytest.raises(InputError, match="cannot write to") as error:
        Session.create(tmp_path / "ses", SessionPlan("memory", "0" * 64), ReadOnly())
    assert error.value.code == "input/session-unwritable"
    assert not list(tmp_path.iterdir())


def test_the_usual_place_of_a_session(tmp_path: Path) -> None:
    from datetime import datetime

    folder = session_folder(tmp_path, "Jo Ann/../x", datetime(2026, 11, 22, 9, 5, 7))
    assert folder == tmp_path / "sub-JoAnnx" / "ses-20261122T090507"


def test_only_beginnings_of_this_program_are_removed(tmp_path: Path) -> None:
    plan = SessionPlan("memory", "0" * 64, {"rig/rig.json": b"{}"})
    mine = (".ses.old.part/a.jpg", ".ses.0123abcd.part/photos/a.jpg", ".ses.0123abce.part/rig/x")
    for name in (*mine, ".ses.0123abce.part/session.json"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("mine")
    (tmp_path / ".ses.0123abcf.part").symlink_to(tmp_path / ".ses.old.part")
    (tmp_path / "ses").mkdir()
    Session.create(tmp_path / "ses", plan).close()
    assert all((tmp_path / name).read_text() == "mine" for name in mine)
    assert verify_session(tmp_path / "ses").whole


def test_recovery_keeps_and_tells_what_is_not_of_this_program(bench: BenchMaker) -> None:
    made = bench(QUICK)
    folder = made.session.folder
    made.rig.capture(made.session, "one")
    made.session.close()
    mine = (".incomplete/raw/anna.jpg", ".incomplete/n.txt", ".incomplete/two/images/rig1/note.txt")
    staged = (".incomplete/two/images/rig1/a/000002.jpg", ".incomplete/.scratch/frames.csv.half")
    for name in (*mine, *staged):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("mine")
    edited = folder / "frames.csv"
    edited.write_text("mine")
    with Session.open(folder) as session:
        assert set(session.recovery.kept) == {*mine, "frames.csv.changed"}
    assert all((folder / name).read_text() == "mine" for name in (*mine, "frames.csv.changed"))
    assert not any((folder / name).exists() for name in staged)
    made.session = Session.open(folder)
    taken = folder / next(f.file.path for f in session.index.records[0].frames)
    (taken.with_name("000002.jpg")).write_text("mine")
    edited.write_text("mine, again")
    assert made.rig.capture(made.session, "two").record.number == 2
    assert all((folder / name).read_text() == "mine" for name in mine)
    assert taken.with_name("000002.jpg.changed").read_text() == "mine"
    assert (folder / "frames.csv.changed.changed").read_text() == "mine, again"


def test_a_link_in_the_place_of_what_is_incomplete_is_told(tmp_path: Path) -> None:
    Session.create(tmp_path / "ses", SessionPlan("memory", "0" * 64)).close()
    (tmp_path / "ses" / ".incomplete").symlink_to(tmp_path)
    with pytest.raises(InputError, match="is a link"):
        Session.open(tmp_path / "ses")
    with pytest.raises(InputError, match="there can be no folder"):
        Session.create(tmp_path / ("n" * 250), SessionPlan("memory", "0" * 64))
