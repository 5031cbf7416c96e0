"""Nothing that this program did not write is ever removed or changed."""

from __future__ import annotations

import errno
import os
import shutil
import socket
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import ConflictError, InputError
from common.files import placing
from common.files.folders import grown_folder, new_folder, whole_folder
from common.files.ownership import MARKER, files_of, foreign, mark
from common.files.writing import remove_unfinished
from service.cli import app

Maker = Callable[[Path], None]


def put(out: Path, **files: str) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        path = out / name.replace("__", "/").replace("_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def ours(out: Path) -> None:
    with new_folder(out, force=False) as folder:
        put(folder, design_json="{}", parts__plate_csv="1")


def _package(out: Path) -> None:
    put(out, __init___py="", adjust_py="x = 1")


def _home(out: Path) -> None:
    put(out, Documents__thesis_tex="mine", _bashrc="", _ssh__id="key")


def _repository(out: Path) -> None:
    put(out, _git__HEAD="ref: refs/heads/main", README_md="x")


def _plain_file(out: Path) -> None:
    out.write_text("mine")


def _link_to_foreign(out: Path) -> None:
    put(out.parent / "elsewhere", notes_txt="mine")
    out.symlink_to(out.parent / "elsewhere")


def _link_to_ours(out: Path) -> None:
    ours(out.parent / "elsewhere")
    out.symlink_to(out.parent / "elsewhere")


def _link_to_empty(out: Path) -> None:
    (out.parent / "elsewhere").mkdir()
    out.symlink_to("elsewhere")


def _dangling_link(out: Path) -> None:
    out.symlink_to("nowhere")


def _link_in_a_circle(out: Path) -> None:
    out.symlink_to(out.name)


def _pipe(out: Path) -> None:
    os.mkfifo(out)


def _with(change: Maker) -> Maker:
    def make(out: Path) -> None:
        ours(out)
        change(out)

    return make


def _link_among_ours(out: Path) -> None:
    put(out.parent / "elsewhere", thesis_tex="mine")
    (out / "more").symlink_to(out.parent / "elsewhere")


def _ours_made_a_link(out: Path) -> None:
    (out / "design.json").rename(out.parent / "kept.json")
    (out / "design.json").symlink_to(out.parent / "kept.json")


def _folder_made_a_link(out: Path) -> None:
    (out / "parts").rename(out.parent / "kept")
    (out / "parts").symlink_to(out.parent / "kept")


def _socket_among_ours(out: Path) -> None:
    here = Path.cwd()
    os.chdir(out)  # the name of a socket must be short
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s")
    os.chdir(here)


def _marker_cut_short(out: Path) -> None:
    text = (out / MARKER).read_text()
    (out / MARKER).write_text(text[: len(text) // 2])


def _marker_a_link(out: Path) -> None:
    (out / MARKER).rename(out.parent / "list")
    (out / MARKER).symlink_to(out.parent / "list")


def _half_of_a_write(out: Path) -> None:
    put(out, design_json="{", _files_x7__part="")


def _a_former_version_s(out: Path) -> None:
    put(out, design_json='{"schema": "rigwright.design/1"}', report_html="<html>")


def _clone_with_results_in_it(out: Path) -> None:
    put(out, calibration____init___py="", README_md="x")
    ours(out / "my-rig")


FOREIGN: dict[str, Maker] = {
    "package": _package,
    "home": _home,
    "repository": _repository,
    "clone with results in it": _clone_with_results_in_it,
    "one note": lambda out: put(out, notes_txt="mine"),
    "hidden file only": lambda out: put(out, _hidden="mine"),
    "nested folders without files": lambda out: (out / "a" / "b").mkdir(parents=True),
    "session": lambda out: put(out, session_json="{}", captures__1_json="{}"),
    "pictures": lambda out: put(out, cam01__0001_png="x", cam02__0001_png="x"),
    "file": _plain_file,
    "pipe": _pipe,
    "link to foreign": _link_to_foreign,
    "link to ours": _link_to_ours,
    "link to empty": _link_to_empty,
    "dangling link": _dangling_link,
    "link in a circle": _link_in_a_circle,
    "half of a write": _half_of_a_write,
    "former version's": _a_former_version_s,
    "marker only": lambda out: put(out, _rigwright_json="{}", notes_txt="mine"),
    "marker not of JSON": lambda out: put(out, _rigwright_json="[1", notes_txt="m"),
    "ours, note added": _with(lambda out: put(out, notes_txt="mine")),
    "ours, note added deep": _with(lambda out: put(out, parts__notes_txt="mine")),
    "ours, hidden file added": _with(lambda out: put(out, _notes="mine")),
    "ours, folder added": _with(lambda out: (out / "mine").mkdir()),
    "ours, changed": _with(lambda out: put(out, design_json="{} ")),
    "ours, changed at equal length": _with(lambda out: put(out, design_json="[]")),
    "ours, link added": _with(_link_among_ours),
    "ours, file made a link": _with(_ours_made_a_link),
    "ours, folder made a link": _with(_folder_made_a_link),
    "ours, pipe added": _with(lambda out: os.mkfifo(out / "pipe")),
    "ours, socket added": _with(_socket_among_ours),
    "ours, write-protected": _with(lambda out: out.chmod(0o555)),
    "ours, file write-protected": _with(lambda out: (out / "design.json").chmod(0o444)),
    "ours, marker cut short": _with(_marker_cut_short),
    "ours, marker a link": _with(_marker_a_link),
    "ours, marker taken away": _with(lambda out: (out / MARKER).unlink()),
    "ours, moved into by others": _with(lambda out: ours(out / "parts" / "other")),
}


def seen(top: Path) -> dict[str, object]:
    """All that is below a folder: kinds, permissions, contents, where links lead."""
    found: dict[str, object] = {}
    for path in sorted(top.rglob("*")):
        name, mode = str(path.relative_to(top)), path.lstat().st_mode
        if path.is_symlink():
            found[name] = mode, os.readlink(path)  # noqa: PTH115 - also of circles
        else:
            found[name] = mode, path.read_text() if path.is_file() else None
    return found


@pytest.fixture(params=FOREIGN.values(), ids=FOREIGN.keys())
def foreign_place(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    out = tmp_path / "place" / "out"
    out.parent.mkdir()
    request.param(out)
    return out


def test_enough_kinds_are_tried() -> None:
    assert len(FOREIGN) >= 30


def test_force_leaves_what_is_not_ours(foreign_place: Path) -> None:
    before = seen(foreign_place.parent)
    with pytest.raises((ConflictError, InputError)), new_folder(foreign_place, force=True):
        raise AssertionError("the folder was given")
    assert seen(foreign_place.parent) == before


def test_a_place_that_changes_while_the_work_runs_is_left_too(tmp_path: Path) -> None:
    out = tmp_path / "out"
    ours(out)
    with pytest.raises(ConflictError, match="holds notes"), new_folder(out, force=True) as folder:
        put(folder, new_json="{}")
        put(out, notes_txt="mine")
        before = seen(out)
    assert seen(out) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("force", [False, True])
def test_a_place_that_others_take_while_the_work_runs_is_left(tmp_path: Path, force: bool) -> None:
    out = tmp_path / "out"
    with pytest.raises((ConflictError, InputError)), new_folder(out, force=force) as folder:
        put(folder, new_json="{}")
        put(out, notes_txt="mine")
    assert list(seen(out)) == ["notes.txt"]


def test_ours_are_replaced_by_force_only(tmp_path: Path) -> None:
    out = tmp_path / "out"
    ours(out)
    with pytest.raises(ConflictError, match="--force"), new_folder(out, force=False):
        raise AssertionError
    (out / "design.json").unlink()  # what is gone cannot be lost
    shutil.copytree(out, tmp_path / "copy")
    for place in (out, tmp_path / "copy"):
        with new_folder(place, force=True) as folder:
            put(folder, new_json="{}")
        assert list(files_of(place)) == ["new.json"]


def test_a_file_that_is_read_again_may_have_been_changed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    ours(out)
    put(out, design_json="{} changed")
    with new_folder(out, force=True, renewed=[out / "design.json"]) as folder:
        put(folder, new_json="{}")
    assert list(files_of(out)) == ["new.json"]


def test_the_folder_one_stands_in_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours(tmp_path / "out")
    monkeypatch.chdir(tmp_path / "out" / "parts")
    for place in (Path(), Path(".."), Path("../..")):
        with pytest.raises(ConflictError, match="you are in"), new_folder(place, force=True):
            raise AssertionError


COMMANDS = {
    "design": ("design", "head.xyz", "--rig", "rig.toml"),
    "plan": ("plan", "design.json", "--mount", "mount.toml", "--scan", "head.xyz"),
    "targets": ("targets", "set.toml"),
    "calibrate": ("calibrate", "pictures", "--targets", "set.toml"),
    "check": ("check", "pictures", "--reference", "cal.json", "--targets", "set.toml"),
    "accept": ("accept", "pictures", "--reference", "cal.json", "--targets", "set.toml"),
    "reconstruct": ("reconstruct", "pictures", "--calibration", "cal.json"),
    "compare": ("compare", "head.xyz", "--truth", "head.xyz"),
    "trial": ("trial", "design.json", "--head", "head.xyz"),
    "study": ("study", "study.toml"),
    "practice": ("practice",),
    "demo": ("demo",),
}


@pytest.fixture(params=COMMANDS.values(), ids=COMMANDS.keys())
def command(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[str, ...]:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pictures").mkdir()
    for name in (
        "head.xyz",
        "rig.toml",
        "design.json",
        "mount.toml",
        "set.toml",
        "cal.json",
        "study.toml",
    ):
        (tmp_path / name).write_text("x")
    given: tuple[str, ...] = request.param
    return given


def refused(command: tuple[str, ...], out: Path) -> None:
    before = seen(out.parent)
    done = CliRunner().invoke(app, [*command, "--out", str(out), "--force"])
    assert done.exit_code == 2, done.output
    assert str(out) in done.stderr
    assert done.stderr.count("\n") == 1
    assert seen(out.parent) == before


def test_every_command_that_writes_a_folder_leaves_sources(
    command: tuple[str, ...], tmp_path: Path
) -> None:
    _package(tmp_path / "place" / "calibration")
    refused(command, tmp_path / "place" / "calibration")


@pytest.mark.slow
def test_every_command_that_writes_a_folder_leaves_what_is_not_ours(
    command: tuple[str, ...], foreign_place: Path
) -> None:
    refused(command, foreign_place)


def test_the_list_names_every_file(tmp_path: Path) -> None:
    put(tmp_path, a_txt="1", b__c_txt="2")
    mark(tmp_path)
    text = (tmp_path / MARKER).read_text()
    assert '"a.txt"' in text and '"b/c.txt"' in text and MARKER not in files_of(tmp_path)


def grown(out: Path, *, force: bool = False, same: bool = True) -> AbstractContextManager[Path]:
    return grown_folder(out, "units", force=force, ours=is_one, same=lambda: same)


def is_one(path: Path) -> bool:
    return path.name in ("one.json", "two.json")


def test_a_folder_grows_and_keeps_what_was_finished_before_it_failed(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    with pytest.raises(ZeroDivisionError), grown(out):
        put(out, units__one_json="1")
        raise ZeroDivisionError
    assert list(files_of(out)) == ["units/one.json"]
    with grown(out) as folder:
        put(out, units__two_json="2")
        put(folder, study_json="{}", parts__a_txt="a")
    assert list(files_of(out)) == ["parts/a.txt", "study.json", "units/one.json", "units/two.json"]
    with grown(out) as folder:
        put(folder, study_json="{ }")
    assert list(files_of(out)) == ["study.json", "units/one.json", "units/two.json"]
    with new_folder(out, force=True) as folder:  # all of it is ours
        put(folder, other_json="{}")
    assert list(files_of(out)) == ["other.json"]


def test_a_grown_folder_that_failed_before_anything_was_finished_is_gone(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), grown(tmp_path / "new" / "out"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_another_work_s_results_does_not_grow_by_itself(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with grown(out) as folder:
        put(folder, study_json="{}")
        put(out, units__one_json="1")
    with pytest.raises(ConflictError, match="--force"), grown(out, same=False):
        raise AssertionError
    with grown(out, same=False, force=True) as folder:
        put(folder, study_json="{}")
    assert list(files_of(out)) == ["study.json", "units/one.json"]


def test_a_folder_that_another_process_grows_is_let_be(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with grown(out) as folder:
        put(folder, study_json="{}")
        with pytest.raises(ConflictError, match="another process works"), grown(out):
            raise AssertionError
    assert list(files_of(out)) == ["study.json"]


def test_what_somebody_lays_into_a_growing_folder_is_not_removed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(ConflictError, match=r"note\.txt"), grown(out) as folder:
        put(folder, study_json="{}")
        put(out, note_txt="mine")
    assert list(files_of(out)) == ["note.txt"]


def test_a_study_s_units_are_ours_and_what_somebody_laid_beside_them_is_not(
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    for _ in range(2):
        with grown(out) as folder:
            put(folder, study_json="{}")
            put(out, units__one_json="1", units__notes_txt="mine", units__sub__x_txt="mine")
    with pytest.raises(ConflictError, match=r"units/notes\.txt"), new_folder(out, force=True):
        raise AssertionError
    assert (out / "units" / "sub" / "x.txt").read_text() == "mine"


def test_what_a_study_reads_is_not_in_the_way_of_what_it_writes(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with grown(out) as folder:
        put(folder, study_json="{}", head_xyz="0")
    with (
        pytest.raises(ConflictError, match=r"head\.xyz, which would be lost"),
        grown_folder(
            out, "units", force=True, ours=is_one, same=bool, spare=lambda: [out / "head.xyz"]
        ),
    ):
        raise AssertionError


def test_an_empty_folder_keeps_its_permissions_and_stays_when_work_fails(tmp_path: Path) -> None:
    made = (new_folder(tmp_path / "one", force=False), grown(tmp_path / "two"))
    for out, folder in zip((tmp_path / "one", tmp_path / "two"), made, strict=True):
        out.mkdir()
        out.chmod(0o2770)
        with folder as half:
            put(half, study_json="{}")
        assert out.stat().st_mode & 0o7777 == 0o2770
    out = tmp_path / "three"
    out.mkdir()
    with pytest.raises(ZeroDivisionError), grown(out):
        raise ZeroDivisionError
    assert list(out.iterdir()) == []


def test_nothing_is_replaced_without_force_that_came_while_the_work_ran(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(ConflictError, match="--force"), new_folder(out, force=False) as folder:
        put(folder, study_json="{}")
        ours(out)
    assert "design.json" in files_of(out)


@pytest.mark.parametrize("at_once", [True, False])
def test_what_stood_there_is_never_lost_when_it_cannot_be_put_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: bool
) -> None:
    if not at_once:
        monkeypatch.setattr(placing, "_exchange", placing._exchange_by_steps)
    exchange, calls = placing._exchange, []

    def once(one: Path, other: Path) -> None:
        calls.append(one)
        if len(calls) > 1:
            raise OSError(errno.EIO, "input/output error")
        exchange(one, other)

    monkeypatch.setattr(placing, "_exchange", once)
    out = tmp_path / "out"
    ours(out)
    with pytest.raises(InputError) as told, new_folder(out, force=True) as folder:
        put(folder, new_json="{}")
        put(out, notes_txt="mine")
    (kept,) = (p for p in tmp_path.rglob("notes.txt"))
    assert kept.read_text() == "mine"
    assert f"it is whole in {kept.parent}" in str(told.value)


@pytest.mark.parametrize("at_once", [True, False])
def test_two_folders_change_places(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: bool
) -> None:
    if not at_once:
        monkeypatch.setattr(placing, "_RENAME_EXCHANGE", 0x1000)  # not one that a kernel knows
    put(tmp_path / "a", a_txt="1")
    put(tmp_path / "b", b_txt="2")
    placing._exchange(tmp_path / "a", tmp_path / "b")
    assert [list(files_of(tmp_path / name)) for name in "ab"] == [["b.txt"], ["a.txt"]]


def _too_long(place: Path) -> Path:
    return place / ("x" * 300)


def _below_a_file(place: Path) -> Path:
    (place / "file").write_text("mine")
    return place / "file" / "out"


def _below_nothing(place: Path) -> Path:
    (place / "link").symlink_to("nowhere")
    return place / "link" / "out"


@pytest.mark.parametrize("kind", [_too_long, _below_a_file, _below_nothing])
def test_a_place_that_cannot_be_is_told_in_one_line(
    tmp_path: Path, kind: Callable[[Path], Path]
) -> None:
    out = kind(tmp_path)
    before = seen(tmp_path)
    for folder in (new_folder(out, force=True), grown(out), whole_folder(out, print)):
        with pytest.raises(InputError) as caught, folder:
            raise AssertionError
        assert "\n" not in str(caught.value)
    assert seen(tmp_path) == before


def test_a_full_disk_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with pytest.raises(InputError, match="free space"), new_folder(out, force=True):
        raise OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(ConnectionError), new_folder(out, force=True):
        raise ConnectionError(errno.ECONNRESET, "not of the disk")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_nothing_where_a_folder_is_to_grow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(InputError, match="free space"), grown(tmp_path / "new" / "out"):
            raise AssertionError("the folder was given")
    assert list(tmp_path.iterdir()) == []


def test_a_write_protected_folder_in_results_is_not_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out"
    ours(out)
    (out / "parts").chmod(0o555)
    with pytest.raises(ConflictError, match="parts, which is write-protected"):
        new_folder(out, force=True).__enter__()
    (out / "parts").chmod(0o755)


def test_what_cannot_be_removed_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    ours(out)
    remove = shutil.rmtree

    def refuse(path: Path, *, ignore_errors: bool = False) -> None:
        if path.name == "old":
            raise PermissionError(errno.EPERM, "Operation not permitted")
        remove(path, ignore_errors=ignore_errors)

    monkeypatch.setattr(shutil, "rmtree", refuse)
    with (
        pytest.raises(InputError, match="holds the new results, but") as told,
        new_folder(out, force=True) as folder,
    ):
        put(folder, new_json="{}")
    (left,) = (path for path in tmp_path.iterdir() if path != out)
    assert str(left) in str(told.value) and files_of(out).keys() == {"new.json"}
    assert "design.json" in files_of(left / "old")


def test_what_a_killed_process_left_half_written_is_ours(tmp_path: Path) -> None:
    ours(tmp_path)
    (tmp_path / ".rigwright-0123456789abcdef").write_text("half")
    assert foreign(tmp_path) is None
    (tmp_path / ".rigwright-notes").write_text("mine")
    assert foreign(tmp_path) is not None
    remove_unfinished(tmp_path)
    assert {p.name for p in tmp_path.glob(".rigwright-*")} == {".rigwright-notes"}
