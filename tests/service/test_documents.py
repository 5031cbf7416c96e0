"""Documents of the store, and the files that jobs are given."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from service_helpers import files_under

from common.errors import NotFoundError
from service.store import Store
from service.store.documents import DocumentRecord
from service.store.jobrecords import JobInput, NewJob
from service.store.tables import JobStatus


def keep(
    store: Store, content: bytes, kind: str = "target-set", name: str = "a b.toml"
) -> DocumentRecord:
    with store.files.stage() as staging:
        staging.write(content)
        return store.documents.add(kind, staging.finish(), name, {"targets": 3})[0]


def test_the_same_content_is_the_same_document_within_its_kind(store: Store) -> None:
    one, again = keep(store, b"x"), keep(store, b"x", name="other.toml")
    other = keep(store, b"x", kind="picture-set")
    assert (one, other.sha256) == (again, one.sha256)
    assert one.id != other.id
    assert store.documents.path(one).read_bytes() == b"x"
    assert len(files_under(store.folder / "blobs")) == 1
    assert [d.id for d in store.documents.page("target-set", 10, None)] == [one.id]


def test_a_document_of_another_kind_is_not_found(store: Store) -> None:
    one = keep(store, b"x")
    with pytest.raises(NotFoundError, match="there is no picture-set"):
        store.documents.get("picture-set", one.id)


def test_a_job_keeps_what_it_was_given(store: Store) -> None:
    one = keep(store, b"x")
    new = NewJob("count", {}, inputs=(one.as_input("targets"),))
    job = store.jobs.create(new, max_pending=9)
    store.documents.remove("target-set", one.id)
    ((role, (name, path)),) = store.jobs.inputs(job.id).items()
    assert (role, name, path.read_bytes()) == ("targets", "a_b.toml", b"x")
    store.jobs.claim_next()
    store.jobs.end(job.id, JobStatus.CANCELLED)
    store.jobs.remove(job.id, "count")
    assert files_under(store.folder / "blobs") == []


def test_a_job_cannot_be_given_what_is_gone(store: Store) -> None:
    new = NewJob("count", {}, inputs=(JobInput("pictures", "a.zip", "0" * 64),))
    with pytest.raises(NotFoundError, match="just been removed"):
        store.jobs.create(new, max_pending=9)
    assert store.jobs.page("count", 9, None) == []


def test_pages_of_documents(store: Store) -> None:
    records = [keep(store, bytes([n])) for n in range(3)]
    assert [d.seq for d in store.documents.page("target-set", 2, None)] == [
        records[2].seq,
        records[1].seq,
    ]
    assert store.documents.page("target-set", 2, records[1].seq) == [records[0]]


def test_a_store_of_the_first_version_is_brought_up_to_date(tmp_path: Path) -> None:
    """Opened, taken back to the first schema, and opened again: its jobs are still there."""
    with Store(tmp_path) as store:
        job = store.jobs.create(NewJob("count", {}), max_pending=9)
    with sqlite3.connect(tmp_path / "rigwright.sqlite3") as connection:
        connection.executescript(
            "DROP TABLE job_inputs; DROP TABLE documents; DROP TABLE sign_ins;"
            "UPDATE alembic_version SET version_num = '0001'"
        )
    connection.close()
    with Store(tmp_path) as store:
        assert store.jobs.get(job.id).status is JobStatus.PENDING
        assert keep(store, b"x").report == {"targets": 3}
