"""Files written whole: links stay, and nothing that is somebody else's is replaced."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from common.errors import ConflictError, InputError
from common.files.writing import neighbour, put_new, with_parents, write_whole


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_a_link_stays_and_the_file_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    real = tmp_path / "elsewhere" / "station.toml"
    real.write_text("old")
    real.chmod(0o640)
    link = tmp_path / "station.toml"
    link.symlink_to(real)
    write_whole(link, b"new", overwrite=True)
    assert link.is_symlink() and real.read_text() == "new" and real.stat().st_mode & 0o777 == 0o640
    assert names_in(tmp_path / "elsewhere") == ["station.toml"]


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("kind", ["dangling", "loop", "folder", "pipe"])
def test_what_is_no_file_is_refused_and_stays(tmp_path: Path, kind: str, overwrite: bool) -> None:
    path = tmp_path / "out"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(tmp_path / ("gone" if kind == "dangling" else "out"))
    before = path.lstat()
    with pytest.raises(InputError if overwrite else ConflictError):
        write_whole(path, b"x", overwrite)
    assert names_in(tmp_path) == ["out"] and path.lstat().st_ino == before.st_ino


@pytest.mark.parametrize("links", [True, False])
def test_what_appears_meanwhile_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    def none(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, "no hard links here")

    if not links:
        monkeypatch.setattr(os, "link", none)
    write_whole(tmp_path / "free", b"whole")
    assert (tmp_path / "free").read_bytes() == b"whole"
    sync = os.fsync

    def meanwhile(handle: int) -> None:
        sync(handle)
        (tmp_path / "out").write_text("theirs")

    monkeypatch.setattr(os, "fsync", meanwhile)
    with pytest.raises(ConflictError, match="out exists already"):
        write_whole(tmp_path / "out", b"ours")
    assert (tmp_path / "out").read_text() == "theirs"
    assert sorted(names_in(tmp_path)) == ["free", "out"]
    (tmp_path / "dangling").symlink_to("nowhere")
    part = neighbour(tmp_path / "out")
    part.write_text("ours")
    with pytest.raises(FileExistsError):
        put_new(part, tmp_path / "dangling")
    assert (tmp_path / "dangling").is_symlink()


@pytest.mark.parametrize(
    ("name", "remedy"), [("n" * 300, "a shorter name"), ("no/folder/x", "a folder that is there")]
)
def test_a_name_that_cannot_be_is_told(tmp_path: Path, name: str, remedy: str) -> None:
    for overwrite in (False, True):
        with pytest.raises(InputError, match=remedy):
            write_whole(tmp_path / name, b"x", overwrite)
    # As long as the disk allows is not too long.
    write_whole(tmp_path / ("n" * 255), b"x")


def test_a_full_disk_is_told_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="free some space"):
        write_whole(tmp_path / "x", b"x")
    assert names_in(tmp_path) == []


def test_folders_made_for_nothing_go_again_and_only_those(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    for put, left in ((None, ["there"]), ("note", ["a", "a/b", "a/note", "there"])):
        with pytest.raises(ZeroDivisionError), with_parents(tmp_path / "a" / "b"):
            if put is not None:
                (tmp_path / "a" / put).write_text("mine")
                (tmp_path / "a" / "b" / put).write_text("mine")
            raise ZeroDivisionError
        found = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*"))
        assert found == (left if put is None else sorted([*left, "a/b/note"]))


def test_a_disk_without_links_that_fails_at_the_end_leaves_no_empty_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, place = tmp_path / "part", tmp_path / "place"
    part.write_text("whole")

    def no_links(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, "no links here")

    def fails(*_: object) -> None:
        raise OSError(errno.EIO, "input/output error")

    monkeypatch.setattr(os, "link", no_links)
    monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(OSError, match="input/output"):
        put_new(part, place)
    assert [p.name for p in tmp_path.iterdir()] == ["part"]


def test_what_is_write_protected_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "station.toml"
    path.write_text("theirs")
    (tmp_path / "link").symlink_to(path)
    # Whoever runs this may be an administrator, to whom the system refuses nothing.
    for mode in (0o400, 0o464, 0o077):
        path.chmod(mode)
        for name, private in ((path, False), (path, True), (tmp_path / "link", False)):
            with pytest.raises(InputError, match="is write-protected; make it writable"):
                write_whole(name, b"ours", overwrite=True, private=private)
        path.chmod(0o600)
        assert path.read_text() == "theirs"


def test_what_is_replaced_keeps_its_attributes_but_not_its_times(tmp_path: Path) -> None:
    path = tmp_path / "station.toml"
    path.write_text("old")
    os.utime(path, (1, 1))
    try:
        os.setxattr(path, "user.who", b"anna")
    except OSError:
        pytest.skip("no extended attributes in the folder for temporary files")
    write_whole(path, b"new", overwrite=True)
    assert os.getxattr(path, "user.who") == b"anna"
    assert path.stat().st_mtime > 1


@pytest.mark.parametrize("private", [False, True])
def test_an_administrator_leaves_files_to_their_owner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, private: bool
) -> None:
    given: list[tuple[str, int, int]] = []

    def chown(path: Path, user: int, group: int) -> None:
        given.append((path.name[:10], user, group))
        if user >= 0:
            raise PermissionError

    path, place = tmp_path / "keys.json", tmp_path.stat()
    path.write_text("old")
    path.chmod(0o4640)
    there = path.stat()
    monkeypatch.setattr(os, "chown", chown)
    write_whole(path, b"new", overwrite=True, private=private)
    assert given == [(".rigwright", -1, there.st_gid), (".rigwright", there.st_uid, -1)]
    assert path.stat().st_mode & 0o7777 == (0o600 if private else 0o4640)
    given.clear()
    write_whole(tmp_path / "new", b"new", private=private)
    assert [user for _, user, _ in given] == ([-1, place.st_uid] if private else [])


def test_a_file_system_without_owners_is_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def chown(*_: object) -> None:
        raise OSError(errno.ENOSYS, "Function not implemented")

    path = tmp_path / "a.txt"
    path.write_text("old")
    monkeypatch.setattr(os, "chown", chown)
    write_whole(path, b"new", overwrite=True)
    assert path.read_bytes() == b"new"
