"""The service and the history of checks keep away from folders of others."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.errors import ConflictError, InputError
from service.cli.commands.check import _earlier
from service.store import Store


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
