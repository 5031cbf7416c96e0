"""Backup and restore, damaged ones too, and data folders in the form of older versions."""

from __future__ import annotations

import os
import sqlite3
import zipfile
from datetime import timedelta
from pathlib import Path

import pytest
from alembic import command
from alembic.config import Config
from service_helpers import files_under, rigwright_here
from sqlalchemy import create_engine
from stations import write_station

from common.errors import ConflictError, InputError
from rig.acquisition.session.verify import verify_session
from rig.acquisition.station.stationfile import read_station
from rig.devices.station import open_station
from service.backups import back_up, restore
from service.keys.keyfile import add_key, read_keys
from service.keys.scope import Scope
from service.stations.removed import RemovedSessions
from service.store import DATABASE_NAME, Store
from service.store.jobrecords import NewJob
from service.store.scans import scan_identity


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def filled(data: Path) -> Store:
    """A store with a scan and a job, and a key beside it."""
    store = Store(data)
    add_key(data, "anna", Scope.READ, None)
    with store.files.stage(".glb") as staging:
        staging.write(b"a head")
        staged = staging.finish()
        store.scans.add(
            staged,
            scan_id=scan_identity(staged.sha256, ".glb", {}),
            filename="head.glb",
            media_type="model/gltf-binary",
            options={},
            report={"vertices": 3, "faces": 1, "extents_mm": [1.0, 2.0, 3.0], "notes": []},
        )
    store.jobs.create(NewJob("count", {"to": 1}), max_pending=10)
    return store


def known(store: Store) -> tuple[str, list[str], list[str]]:
    scans = [scan.id for scan in store.scans.page(10, None)]
    return store.service_uuid, scans, [job.id for job in store.jobs.page("count", 10, None)]


@pytest.fixture
def backup(tmp_path: Path) -> Path:
    data = tmp_path / "data"
    filled(data).close()
    back_up(data, data / "sessions", tmp_path / "b.zip")
    return tmp_path / "b.zip"


def test_what_is_restored_is_what_was_there_while_it_ran(tmp_path: Path) -> None:
    with filled(tmp_path / "data") as store:
        done = rigwright_here("backup", "b.zip", "--data", "data", cwd=tmp_path)
        assert done.returncode == 0 and done.stdout.startswith("b.zip: 1 files and 0 sessions")
        before = known(store)
    assert (tmp_path / "b.zip").stat().st_mode & 0o077 == 0
    done = rigwright_here("restore", "b.zip", "--data", "new", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with Store(tmp_path / "new") as again:
        assert known(again) == before
        assert again.scans.path(again.scans.get(before[1][0])).read_bytes() == b"a head"
    assert [key.name for key in read_keys(tmp_path / "new")] == ["anna"]
    assert (tmp_path / "new" / "keys.json").stat().st_mode & 0o777 == 0o600


def test_sessions_come_along_whole_or_as_they_are(tmp_path: Path) -> None:
    data = tmp_path / "data"
    filled(data).close()
    sessions = data / "sessions"
    sessions.mkdir()
    with (
        open_station(read_station(write_station(tmp_path / "rig"))) as rig,
        rig.new_session(sessions / "anna", "anna", "") as session,
    ):
        rig.capture(session, "one")
    (sessions / "bert").mkdir()
    (sessions / "bert" / "session.json").write_text("broken")
    made = back_up(data, sessions, tmp_path / "b.zip")
    assert (made.sessions, made.damaged) == (2, ("bert",))
    restore(tmp_path / "b.zip", tmp_path / "new")
    assert verify_session(tmp_path / "new" / "sessions" / "anna").whole
    assert (tmp_path / "new" / "sessions" / "bert" / "session.json").read_text() == "broken"


def test_a_deleted_session_can_be_brought_back_from_a_backup(tmp_path: Path) -> None:
    data = tmp_path / "data"
    filled(data).close()
    for name in ("anna", "bert"):
        (data / "sessions" / name / "images").mkdir(parents=True)
        (data / "sessions" / name / "session.json").write_text("not read here")
        (data / "sessions" / name / "images" / "1.jpg").write_bytes(b"anna")
    away = RemovedSessions(data / "sessions", timedelta(days=7)).remove(data / "sessions" / "anna")
    made = back_up(data, data / "sessions", tmp_path / "b.zip")
    assert (made.sessions, made.removed) == (1, 1)
    done = rigwright_here("restore", "b.zip", "--data", "new", cwd=tmp_path)
    assert "1 sessions and 1 deleted ones that can be restored" in done.stdout
    back = RemovedSessions(tmp_path / "new" / "sessions", timedelta(days=7))
    assert [one.id for one in back.all()] == [away.id]
    assert back.restore(away.id) == "anna"
    assert (tmp_path / "new" / "sessions" / "anna" / "images" / "1.jpg").read_bytes() == b"anna"


def test_nothing_is_replaced(tmp_path: Path, backup: Path) -> None:
    with pytest.raises(ConflictError, match="there already"):
        back_up(tmp_path / "data", tmp_path / "data" / "sessions", backup)
    with pytest.raises(ConflictError, match="not empty"):
        restore(backup, tmp_path / "data")
    with pytest.raises(InputError, match="no data of a service"):
        back_up(tmp_path, tmp_path, tmp_path / "other.zip")


@pytest.mark.parametrize(
    "fault", ["cut", "content", "blob", "stranger", "outside", "hidden", "no zip"]
)
def test_an_unsound_backup_leaves_nothing(tmp_path: Path, backup: Path, fault: str) -> None:
    bad = tmp_path / "bad.zip"
    if fault in ("cut", "content", "no zip"):
        raw = backup.read_bytes()
        # The head's own letters lie uncompressed in it.
        changed = {"cut": raw[:-300], "content": raw.replace(b"a head", b"a hand"), "no zip": b"x"}
        bad.write_bytes(changed[fault])
    else:
        with zipfile.ZipFile(backup) as old, zipfile.ZipFile(bad, "w") as new:
            for name in old.namelist():
                if fault == "blob" and name.startswith("blobs/"):
                    continue
                new.writestr(name, old.read(name))
            strange = {
                "stranger": "setup.py",
                "outside": "sessions/a/../../x",
                "hidden": "sessions/.removed/anna/x",
            }
            if fault in strange:
                new.writestr(strange[fault], "x")
    before = files_under(tmp_path)
    with pytest.raises(InputError):
        restore(bad, tmp_path / "p" / "q" / "new")
    assert files_under(tmp_path) == before and not (tmp_path / "p").exists()


def test_a_backup_does_not_replace_what_appears_meanwhile(
    tmp_path: Path, backup: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, data, sync = tmp_path / "out.zip", tmp_path / "data", os.fsync

    def meanwhile(handle: int) -> None:
        sync(handle)
        out.write_text("mine")

    out.symlink_to("nowhere")
    with pytest.raises(ConflictError, match="there already"):
        back_up(data, data / "sessions", out)
    assert out.is_symlink()
    out.unlink()
    monkeypatch.setattr(os, "fsync", meanwhile)
    with pytest.raises(ConflictError, match="there already"):
        back_up(data, data / "sessions", out)
    assert out.read_text() == "mine" and backup.is_file()
    assert sorted(names_in(tmp_path)) == ["b.zip", "data", "out.zip"]


def test_a_second_restore_and_what_is_put_there_meanwhile_stay_apart(
    tmp_path: Path, backup: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new, seen = tmp_path / "new", []

    class Meanwhile(Store):
        def close(self) -> None:
            super().close()
            with pytest.raises(ConflictError, match="another command works"):
                restore(backup, new)
            (new / "mine.txt").write_text("mine")
            if seen:
                (new / "blobs").mkdir()
            seen.append(files_under(new))

    monkeypatch.setattr("service.backups.Store", Meanwhile)
    restore(backup, new)
    assert (new / "mine.txt").read_text() == "mine"
    with Store(new) as store:
        assert len(known(store)[1]) == 1
    new = tmp_path / "other"
    with pytest.raises(ConflictError, match="blobs appeared while"):
        restore(backup, new)
    assert sorted(names_in(new)) == ["blobs", "mine.txt"]


def test_the_remains_of_a_stopped_restore_are_told(tmp_path: Path, backup: Path) -> None:
    (tmp_path / "new" / ".restore-ab12cd").mkdir(parents=True)
    with pytest.raises(ConflictError, match="a restore was stopped and left"):
        restore(backup, tmp_path / "new")
    # Stopped while all was put in its place.
    (tmp_path / "new" / "lock").touch()
    with pytest.raises(ConflictError, match=r"left \.restore-ab12cd there: remove that, and the"):
        restore(backup, tmp_path / "new")
    (tmp_path / "new" / "lock").unlink()
    # A disk of its own has this folder from the beginning.
    (tmp_path / "new" / ".restore-ab12cd").rename(tmp_path / "new" / "lost+found")
    restore(backup, tmp_path / "new")
    assert {"lost+found", DATABASE_NAME} < set(names_in(tmp_path / "new"))


def test_places_that_cannot_be_are_told_in_a_line(tmp_path: Path, backup: Path) -> None:
    (tmp_path / "file").write_text("mine")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is no folder"):
        restore(backup, tmp_path / "file")
    with pytest.raises(InputError, match="is no file"):
        restore(tmp_path / "pipe", tmp_path / "new")
    for bad in (tmp_path / ("n" * 300), tmp_path / "file" / "new"):
        with pytest.raises(InputError):
            restore(backup, bad)
        with pytest.raises(InputError):
            back_up(tmp_path / "data", tmp_path / "none", bad)
    (tmp_path / "junk").mkdir()
    (tmp_path / "junk" / DATABASE_NAME).write_bytes(b"this is not a database" * 100)
    with pytest.raises(InputError, match="cannot be read"):
        back_up(tmp_path / "junk", tmp_path / "none", tmp_path / "out.zip")
    assert not (tmp_path / "out.zip").exists() and not (tmp_path / "new").exists()


@pytest.mark.parametrize("revision", ["0001", "0002"])
def test_a_folder_of_an_older_version_is_brought_up_to_date(tmp_path: Path, revision: str) -> None:
    data = tmp_path / "data"
    data.mkdir()
    config = Config()
    config.set_main_option("script_location", "service.store:migrations")
    engine = create_engine(f"sqlite:///{data / DATABASE_NAME}")
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
    engine.dispose()
    connection = sqlite3.connect(data / DATABASE_NAME)
    connection.execute("INSERT INTO identity VALUES (1, 'as-before', '2026-01-31T12:00:00+00:00')")
    connection.execute(
        "INSERT INTO jobs (id, kind, status, request, cancel_requested, created_at)"
        " VALUES ('old', 'count', 'pending', '{\"to\": 1}', 0, '2026-01-31T12:00:00.000+00:00')"
    )
    connection.commit()
    connection.close()
    # An older folder can be backed up before the newer program has touched it.
    back_up(data, data / "sessions", tmp_path / "old.zip")
    restore(tmp_path / "old.zip", tmp_path / "new")
    for folder in (data, tmp_path / "new"):
        with Store(folder) as store:
            assert known(store) == ("as-before", [], ["old"])
            assert store.sign_ins.get("nobody") is None
