"""The service and the history of checks keep away from folders of others."""

from __future__ import annotations

import os
import shutil
import socket
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from service_helpers import files_under, rigwright_here

from common.errors import ConflictError, InputError
from service.cli.commands.check import _earlier
from service.store import DATABASE_NAME, Store
from service.store.ours import refuse_foreign


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_a_data_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "thesis.tex").write_text("mine")
    (tmp_path / "lock").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        Store(tmp_path)
    assert (tmp_path / "work" / "thesis.tex").read_text() == "mine"
    assert (tmp_path / "lock").read_text() == "mine"


@pytest.mark.parametrize("before", [(), ("lock",), ("lost+found",)])
def test_a_new_data_folder_is_begun_and_opened_again(
    tmp_path: Path, before: tuple[str, ...]
) -> None:
    for name in before:
        (tmp_path / name).write_text("")
    for _ in range(2):
        Store(tmp_path).close()


MINE = (
    "work/thesis.tex",
    "work/import-of-mine/a.jpg",
    "tmp/scan-of-anna.ply",
    "tmp/folder/a.ply",
    "blobs/sha256/ab/cd/mine",
    "blobs/sha256/ab/note.txt",
)


def put(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("mine")


def content(folder: Path) -> dict[str, bytes]:
    files = (path for path in files_under(folder) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_files_of_others_within_real_data_stay(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    data = tmp_path / "data"
    Store(data).close()
    put(data, *MINE)
    Store(data).close()
    assert all((data / name).read_text() == "mine" for name in MINE)
    assert "left alone" in caplog.text


def test_nothing_is_removed_through_a_link(tmp_path: Path) -> None:
    data, scratch = tmp_path / "data", tmp_path / "scratch"
    Store(data).close()
    names = (f"{'ab' * 16}.ply", f"import-{'ab' * 8}/a.jpg", f"sha256/ab/ab/{'ab' * 32}")
    put(scratch, *names)
    (data / "work").mkdir(exist_ok=True)
    for name in ("tmp", "work", "blobs"):
        shutil.rmtree(data / name)
        (data / name).symlink_to(scratch)
    Store(data).close()
    assert all((scratch / name).read_text() == "mine" for name in names)
    for name in ("tmp", "work", "blobs"):
        (data / name).unlink()
        (data / name).mkdir()
    (data / "work" / f"import-{'ab' * 8}").symlink_to(scratch)
    (data / "blobs" / "sha256").symlink_to(scratch / "sha256")
    Store(data).close()
    assert all((scratch / name).read_text() == "mine" for name in names)


def marker(folder: Path, kind: str) -> None:
    folder.mkdir(exist_ok=True)
    database = folder / DATABASE_NAME
    if kind == "empty":
        database.touch()
    elif kind == "junk":
        database.write_bytes(b"this is not a database" * 100)
    elif kind == "folder":
        database.mkdir()
    elif kind == "dangling":
        database.symlink_to(folder.parent / "gone")
    elif kind == "other":
        with closing(sqlite3.connect(database)) as connection, connection:
            connection.execute("CREATE TABLE jobs (id TEXT)")


@pytest.mark.parametrize("kind", ["empty", "junk", "other", "folder", "dangling"])
def test_a_forged_database_is_refused_and_nothing_changes(tmp_path: Path, kind: str) -> None:
    data = tmp_path / "data"
    marker(data, kind)
    put(data, *MINE)
    before = content(data)
    with pytest.raises(InputError):
        Store(data)
    assert content(data) == before and sorted(names_in(tmp_path)) == ["data"]


def test_a_first_start_that_was_cut_short_is_begun_again(tmp_path: Path) -> None:
    marker(tmp_path, "empty")
    (tmp_path / "lock").write_text("123")
    Store(tmp_path).close()


def test_data_whose_service_was_killed_are_known(tmp_path: Path) -> None:
    with Store(tmp_path / "live") as store:
        # All of the first start is in the log of changes yet, as it is after kill -9.
        shutil.copytree(tmp_path / "live", tmp_path / "killed")
        identity = store.service_uuid
    with Store(tmp_path / "killed") as store:
        assert store.service_uuid == identity


@pytest.mark.parametrize("real", [True, False])
@pytest.mark.parametrize("kind", ["text", "large", "folder", "link", "pipe"])
def test_a_lock_of_others_is_left_alone(tmp_path: Path, kind: str, real: bool) -> None:
    data, lock = tmp_path / "data", tmp_path / "data" / "lock"
    if real:
        Store(data).close()
        lock.unlink()
    data.mkdir(exist_ok=True)
    if kind == "folder":
        lock.mkdir()
    elif kind == "link":
        lock.symlink_to(tmp_path / "elsewhere")
    elif kind == "pipe":
        os.mkfifo(lock)
    else:
        lock.write_text("mine" if kind == "text" else "1" * 1000)
    before = sorted(names_in(data))
    with pytest.raises(InputError, match="lock"):
        Store(data)
    assert sorted(names_in(data)) == before and sorted(names_in(tmp_path)) == ["data"]
    if kind in ("text", "large"):
        assert lock.read_text() in ("mine", "1" * 1000)


@pytest.mark.parametrize("name", ["tmp", "blobs", "work"])
def test_a_file_in_the_place_of_a_folder_is_told(tmp_path: Path, name: str) -> None:
    Store(tmp_path).close()
    shutil.rmtree(tmp_path / name, ignore_errors=True)
    (tmp_path / name).write_text("mine")
    for _ in range(2):
        with pytest.raises(InputError, match="cannot be used"):
            Store(tmp_path)
    assert (tmp_path / name).read_text() == "mine"


def test_a_page_of_others_is_no_history(tmp_path: Path) -> None:
    page = tmp_path / "history.html"
    page.write_text("<h1>Rome</h1>")
    with pytest.raises(ConflictError, match="was not written by this program"):
        _earlier(tmp_path)
    page.rename(tmp_path / "rome.html")
    page.symlink_to(tmp_path / "rome.html")
    with pytest.raises(ConflictError, match="was not written by this program"):
        _earlier(tmp_path)
    page.unlink()
    page.write_text('<html><meta name="generator" content="Rigwright"></html>')
    assert _earlier(tmp_path) == {}


def test_what_a_killed_command_left_is_no_file_of_others(tmp_path: Path) -> None:
    (tmp_path / ".rigwright-0123456789abcdef").write_text("half")
    refuse_foreign(tmp_path)
    (tmp_path / ".rigwright-mine").write_text("whole")
    with pytest.raises(InputError, match="rigwright-mine"):
        refuse_foreign(tmp_path)


def test_a_service_that_cannot_answer_makes_no_data_folder(tmp_path: Path) -> None:
    (tmp_path / "cert.pem").write_text("none")
    tls = ("--tls-cert", "cert.pem", "--tls-key", "cert.pem")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        for given, words in ((("--port", port), "cannot listen"), (tls, "are no certificate")):
            done = rigwright_here("serve", *given, "--data", "p/data", cwd=tmp_path)
            assert done.returncode == 2 and words in done.stderr
            assert not (tmp_path / "p").exists()
