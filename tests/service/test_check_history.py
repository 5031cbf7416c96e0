"""The page of a history of checks is written anew, but never over what somebody made of it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from common.errors import ConflictError, InputError
from common.files.ownership import MARKER, foreign, mark
from service.cli.commands.check import HISTORY_PAGE, _add_to_history, _earlier


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "check.json").write_text("{}")
    (folder / HISTORY_PAGE).write_text('<meta name="generator" content="Rigwright">')
    return folder


def test_our_page_is_written_anew_and_an_edited_one_is_left(tmp_path: Path, out: Path) -> None:
    history = tmp_path / "history"
    for number in range(2):
        assert len(_earlier(history)) == number
        _add_to_history(out, history, f"2026-01-0{number + 1}T00:00:00+00:00")
    page = history / HISTORY_PAGE
    edited = page.read_text() + "<p>cam03 was knocked by the cleaner</p>"
    page.write_text(edited)
    with pytest.raises(ConflictError, match="was changed since"):
        _earlier(history)
    assert page.read_text() == edited


def test_a_page_from_before_there_was_a_list_is_known_by_its_tag(tmp_path: Path, out: Path) -> None:
    history = tmp_path / "history"
    history.mkdir()
    (history / HISTORY_PAGE).write_text("<p>mine</p>")
    with pytest.raises(ConflictError):
        _earlier(history)
    (history / HISTORY_PAGE).write_bytes((out / HISTORY_PAGE).read_bytes())
    assert _earlier(history) == {}


def test_a_place_that_cannot_be_is_told_before_the_work(tmp_path: Path, out: Path) -> None:
    (tmp_path / "link").symlink_to("nowhere")
    for place in (out / "check.json", out / "check.json" / "history", tmp_path / "link"):
        with pytest.raises(InputError, match=r"is (a file|no folder)"):
            _earlier(place)


@pytest.mark.parametrize("kind", ["link", "text", "pipe", "folder"])
def test_a_list_that_is_not_ours_is_refused_and_left(tmp_path: Path, out: Path, kind: str) -> None:
    history, notes = tmp_path / "history", tmp_path / "notes.json"
    history.mkdir()
    marker = history / MARKER
    notes.write_text('{"precious": "anna"}')
    if kind == "link":
        marker.symlink_to(notes)
    elif kind == "text":
        marker.write_bytes(notes.read_bytes())
    elif kind == "pipe":
        os.mkfifo(marker)
    else:
        marker.mkdir()
    before = marker.lstat()
    for work in (lambda: _earlier(history), lambda: _add_to_history(out, history, "2026")):
        with pytest.raises(ConflictError, match=f"{MARKER} was not written by this program"):
            work()
    assert notes.read_text() == '{"precious": "anna"}' and marker.lstat() == before


def test_a_history_in_a_folder_of_results_leaves_them_ours(tmp_path: Path, out: Path) -> None:
    results = tmp_path / "cal"
    results.mkdir()
    (results / "calibration.json").write_text("{}")
    mark(results)
    _add_to_history(out, results, "20260101")
    assert _earlier(results)
    (results / "check-20260101.json").unlink()
    assert foreign(results) is None
