from __future__ import annotations

import sqlite3
import threading
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from hypothesis import given, settings
from hypothesis import strategies as st
from service_helpers import files_under
from sqlalchemy import insert, text, update
from sqlalchemy.exc import IntegrityError

from common.errors import ConflictError, InputError, InternalError, NotFoundError
from service.store import Store, idempotency
from service.store.idempotency import IdempotencyKey
from service.store.jobrecords import NewJob
from service.store.scans import ScanRecord, scan_identity
from service.store.tables import JobStatus, blobs, jobs, metadata

REPORT = {"vertices": 3, "faces": 1, "extents_mm": [1.0, 2.0, 3.0], "notes": []}


def keep_scan(store: Store, content: bytes, name: str = "head.glb", **options: str) -> ScanRecord:
    with store.files.stage(".glb") as staging:
        staging.write(content)
        staged = staging.finish()
        record, _ = store.scans.add(
            staged,
            scan_id=scan_identity(staged.sha256, ".glb", options),
            filename=name,
            media_type="model/gltf-binary",
            options=options,
            report=REPORT,
        )
    return record


def add_job(store: Store, **given: object) -> str:
    return store.jobs.create(NewJob("count", {"to": 1}, **given), max_pending=1000).id


def test_the_migrations_build_the_tables_the_code_uses(store: Store) -> None:
    def difference(connection: object) -> list[object]:
        return compare_metadata(MigrationContext.configure(connection), metadata)

    assert store.database.read(difference) == []


def test_the_database_is_set_up_to_last(store: Store) -> None:
    def ask(name: str) -> object:
        return store.database.write(lambda connection: connection.scalar(text(f"PRAGMA {name}")))

    assert ask("journal_mode") == "wal"
    assert ask("synchronous") == 2  # FULL
    assert ask("foreign_keys") == 1
    assert ask("busy_timeout") == 5000


def test_readers_cannot_write(store: Store) -> None:
    with pytest.raises(Exception, match="readonly"):
        store.database.read(lambda connection: connection.execute(text("DELETE FROM jobs")))


def test_a_failed_change_leaves_nothing_and_the_next_one_works(store: Store) -> None:
    def half(connection: object) -> None:
        connection.execute(insert(blobs).values(sha256="ab", size_bytes=1, created_at="now"))
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        store.database.write(half)
    count = text("SELECT count(*) FROM blobs")
    assert store.database.read(lambda connection: connection.scalar(count)) == 0
    add_job(store)


def test_many_threads_may_write_at_once(store: Store) -> None:
    threads = [threading.Thread(target=add_job, args=(store,)) for _ in range(24)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    listed = store.jobs.page("count", 100, None)
    assert len({job.id for job in listed}) == 24
    assert [job.seq for job in listed] == sorted((job.seq for job in listed), reverse=True)


def test_a_closed_store_says_so(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.close()
    with pytest.raises(InternalError, match="closed"):
        add_job(store)


def test_two_services_cannot_share_a_folder(store: Store) -> None:
    with pytest.raises(
        ConflictError, match=r"another service \(process \d+\) uses the data folder"
    ) as caught:
        Store(store.folder)
    assert caught.value.code == "conflict/data-folder-in-use"


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be used"):
        Store(tmp_path / "file")


def test_a_damaged_or_newer_database_is_told(tmp_path: Path) -> None:
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "rigwright.sqlite3").write_bytes(b"this is not a database" * 100)
    with pytest.raises(InputError, match="damaged"):
        Store(tmp_path / "damaged")
    Store(tmp_path / "newer").close()
    with sqlite3.connect(tmp_path / "newer" / "rigwright.sqlite3") as connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    connection.close()
    for _ in range(2):  # the first failure must not keep the folder locked
        with pytest.raises(InputError, match="newer version"):
            Store(tmp_path / "newer")


def test_the_service_keeps_its_id(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        first = store.service_uuid
    with Store(tmp_path) as store:
        assert store.service_uuid == first


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(content=st.binary(max_size=4096))
def test_files_come_back_as_they_went_in(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    with Store(tmp_path_factory.mktemp("store")) as store:
        record = keep_scan(store, content)
        path = store.scans.path(record)
        assert path.read_bytes() == content
        assert path.parts[-4:] == ("sha256", record.sha256[:2], record.sha256[2:4], record.sha256)
        assert record.size_bytes == len(content)


def test_the_same_file_is_kept_once_and_leaves_with_its_last_scan(store: Store) -> None:
    first = keep_scan(store, b"surface")
    again = keep_scan(store, b"surface")
    other = keep_scan(store, b"surface", units="m")
    assert first == again
    assert other.id != first.id
    assert other.sha256 == first.sha256
    assert len(files_under(store.folder / "blobs")) == 1
    store.scans.remove(first.id)
    assert store.scans.path(other).exists()
    store.scans.remove(other.id)
    assert files_under(store.folder / "blobs") == []
    assert files_under(store.folder / "tmp") == []


def test_an_upload_that_fails_leaves_nothing(store: Store) -> None:
    with pytest.raises(ZeroDivisionError), store.files.stage(".glb") as staging:
        staging.write(b"half")
        raise ZeroDivisionError
    assert files_under(store.folder / "tmp") == []


def test_a_scan_that_a_job_needs_stays(store: Store) -> None:
    scan = keep_scan(store, b"surface")
    job = add_job(store, scan_id=scan.id)
    with pytest.raises(ConflictError) as caught:
        store.scans.remove(scan.id)
    assert caught.value.code == "conflict/scan-in-use"
    store.jobs.request_cancel(job, "count")
    store.scans.remove(scan.id)
    assert store.jobs.get(job).scan_id is None


def test_a_job_for_a_scan_that_is_gone_is_refused(store: Store) -> None:
    with pytest.raises(NotFoundError):
        add_job(store, scan_id="gone")


def test_what_a_crash_left_is_put_right(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        scan = keep_scan(store, b"surface")
        ran, waited, done = (add_job(store) for _ in range(3))
        store.jobs.claim_next()
        store.jobs.complete(done, {"fine": True}, {})
        (tmp_path / "tmp" / f"{'ab' * 16}.glb").write_bytes(b"half an upload")
        orphan = tmp_path / "blobs" / "sha256" / "00" / "11" / ("0011" + "0" * 60)
        orphan.parent.mkdir(parents=True)
        orphan.write_bytes(b"a file whose row was never written")
        store.work_folder(ran)
        store.import_folder()
        store.database.write(
            lambda connection: idempotency.claim(connection, IdempotencyKey("count", "key"))
        )
    with Store(tmp_path) as store:
        assert store.jobs.get(ran).status is JobStatus.INTERRUPTED
        assert (store.jobs.get(ran).problem or {})["detail"] == "service-stopped"
        assert store.jobs.get(waited).status is JobStatus.PENDING
        assert store.jobs.get(done).status is JobStatus.COMPLETED
        assert store.jobs.get(done).result == {"fine": True}
        assert files_under(tmp_path / "blobs") == [store.scans.path(scan)]
        assert files_under(tmp_path / "tmp") == files_under(tmp_path / "work") == []
        claimed = store.database.write(
            lambda connection: idempotency.claim(connection, IdempotencyKey("count", "key"))
        )
        assert claimed is None


def test_the_database_itself_keeps_terminal_states(store: Store) -> None:
    job = add_job(store)
    store.jobs.request_cancel(job, "count")
    for status in JobStatus:
        change = update(jobs).where(jobs.c.id == job).values(status=status)
        if status is JobStatus.CANCELLED:
            store.database.write(lambda connection, change=change: connection.execute(change))
        else:
            with pytest.raises(IntegrityError, match="has ended"):
                store.database.write(lambda connection, change=change: connection.execute(change))
    assert store.jobs.get(job).status is JobStatus.CANCELLED


def test_events_count_from_one_and_can_be_followed_from_anywhere(store: Store) -> None:
    job = add_job(store)
    store.jobs.claim_next()
    for n in range(3):
        store.jobs.record_progress(job, {"fraction": n / 3})
    store.jobs.complete(job, {}, {})
    events = store.jobs.events_after(job, 0)
    assert [event.id for event in events] == [1, 2, 3, 4, 5, 6]
    assert [event.type for event in events] == [
        "pending",
        "running",
        *["progress"] * 3,
        "completed",
    ]
    assert store.jobs.events_after(job, 4) == events[4:]


def test_the_queue_has_an_end(store: Store) -> None:
    for _ in range(2):
        store.jobs.create(NewJob("count", {}), max_pending=2)
    with pytest.raises(ConflictError) as caught:
        store.jobs.create(NewJob("count", {}), max_pending=2)
    assert caught.value.code == "conflict/queue-full"


def test_jobs_are_removed_with_their_files_when_they_have_ended(
    store: Store, tmp_path: Path
) -> None:
    job = add_job(store)
    with pytest.raises(ConflictError):
        store.jobs.remove(job, "count")
    made = tmp_path / "made.txt"
    made.write_text("numbers")
    store.jobs.claim_next()
    store.jobs.complete(job, {}, {"made.txt": (store.files.stage_existing(made), "text/plain")})
    assert [file.path.read_text() for file in store.jobs.files(job)] == ["numbers"]
    store.jobs.remove(job, "count")
    assert files_under(store.folder / "blobs") == []
    with pytest.raises(NotFoundError):
        store.jobs.get(job)


def test_a_job_of_another_kind_is_not_found(store: Store) -> None:
    with pytest.raises(NotFoundError, match="there is no design"):
        store.jobs.get(add_job(store), "design")


class TestIdempotency:
    def create(self, store: Store, key: str, sha: str) -> str:
        return store.jobs.create(
            NewJob("count", {"to": 1}),
            max_pending=10,
            idempotency_key=IdempotencyKey("count", key),
            request_sha256=sha,
        ).id

    def test_the_same_key_gets_the_same_job(self, store: Store) -> None:
        assert self.create(store, "a", "1") == self.create(store, "a", "1")
        assert self.create(store, "b", "1") != self.create(store, "a", "1")
        assert len(store.jobs.page("count", 10, None)) == 2

    def test_another_request_under_the_same_key_is_refused(self, store: Store) -> None:
        self.create(store, "a", "1")
        with pytest.raises(InputError) as caught:
            self.create(store, "a", "2")
        assert caught.value.code == "input/idempotency-key-reused"

    def test_a_key_in_flight_is_refused_and_free_after_a_failure(self, store: Store) -> None:
        key = IdempotencyKey("scans", "a")
        assert store.database.write(lambda connection: idempotency.claim(connection, key)) is None
        with pytest.raises(ConflictError) as caught:
            store.database.write(lambda connection: idempotency.claim(connection, key))
        assert caught.value.code == "conflict/idempotency-in-flight"
        store.database.write(lambda connection: idempotency.release(connection, key))
        assert store.database.write(lambda connection: idempotency.claim(connection, key)) is None

    def test_the_answer_survives_a_restart_for_a_week(self, tmp_path: Path) -> None:
        with Store(tmp_path) as store:
            first = self.create(store, "a", "1")
        with Store(tmp_path) as store:
            assert self.create(store, "a", "1") == first
        with sqlite3.connect(tmp_path / "rigwright.sqlite3") as connection:
            connection.execute(
                "UPDATE idempotency SET created_at = '2000-01-01T00:00:00.000+00:00'"
            )
        connection.close()
        with Store(tmp_path) as store:
            assert self.create(store, "a", "1") != first


class TestJobsUnderAnIdTheClientChose:
    def test_they_run_at_once_and_a_repeat_gives_the_same(self, store: Store) -> None:
        new = NewJob("capture", {"rig": "studio"})
        job, fresh = store.jobs.begin(new, "cap-1")
        assert (job.id, job.status, fresh) == ("cap-1", JobStatus.RUNNING, True)
        assert job.started_at is not None
        assert store.jobs.claim_next() is None
        store.jobs.complete("cap-1", {"whole": True}, {})
        again, fresh = store.jobs.begin(new, "cap-1")
        assert (again.status, again.result, fresh) == (JobStatus.COMPLETED, {"whole": True}, False)
        assert [event.type for event in store.jobs.events_after("cap-1", 0)] == [
            "running",
            "completed",
        ]

    def test_another_request_under_the_id_is_refused(self, store: Store) -> None:
        store.jobs.begin(NewJob("capture", {"rig": "studio"}), "cap-1")
        for other in (NewJob("capture", {"rig": "lab"}), NewJob("self-test", {"rig": "studio"})):
            with pytest.raises(ConflictError) as caught:
                store.jobs.begin(other, "cap-1")
            assert caught.value.detail == "id-used"

    def test_after_a_crash_they_wait_for_whoever_knows(self, tmp_path: Path) -> None:
        with Store(tmp_path / "data") as store:
            store.jobs.begin(NewJob("capture", {}), "cap-1")
            store.jobs.begin(NewJob("count", {}), "job-1")
        with Store(tmp_path / "data", settled_elsewhere=("capture",)) as store:
            assert store.jobs.get("job-1").status is JobStatus.INTERRUPTED
            assert [job.id for job in store.jobs.running(("capture",))] == ["cap-1"]
