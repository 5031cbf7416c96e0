"""The link to a fake box: only what such a box made is replaced or removed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from common.errors import InputError
from rig.acquisition.trigger.endpoint import PtyEndpoint


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


@pytest.mark.parametrize("kind", ["file", "folder", "link", "dangling"])
def test_what_is_there_is_refused_and_stays(tmp_path: Path, kind: str) -> None:
    link = tmp_path / "box"
    (tmp_path / "mine").mkdir()
    if kind == "file":
        link.write_text("mine")
    elif kind == "folder":
        link.mkdir()
    else:
        link.symlink_to("mine" if kind == "link" else "gone")
    before = link.lstat()
    with pytest.raises(InputError, match="is there already"):
        PtyEndpoint(link)
    assert link.lstat().st_ino == before.st_ino
    assert sorted(names_in(tmp_path)) == ["box", "mine"]


def test_the_link_of_a_box_that_was_killed_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "box"
    killed, new = PtyEndpoint(link), PtyEndpoint(link)
    theirs = str(link.readlink())
    # It is the other's by now.
    killed.unplug()
    assert str(link.readlink()) == theirs
    new.unplug()
    assert not os.path.lexists(link)


def test_what_took_the_place_of_the_link_stays(tmp_path: Path) -> None:
    link = tmp_path / "box"
    box = PtyEndpoint(link)
    link.unlink()
    link.write_text("mine")
    box.unplug()
    assert link.read_text() == "mine"


@pytest.mark.parametrize("name", ["no/folder/box", "b" * 300])
def test_a_link_that_cannot_be_made_is_told(tmp_path: Path, name: str) -> None:
    before = len(names_in(Path("/dev/fd")))
    with pytest.raises(InputError, match="cannot be made"):
        PtyEndpoint(tmp_path / name)
    assert len(names_in(Path("/dev/fd"))) == before
