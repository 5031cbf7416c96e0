"""The page about cameras says what the code does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from common.files.strict import StrictModel, keys_of
from rig.acquisition.cameras import aravis, folder, genicam, gphoto2, opencv
from rig.devices.registry import BACKENDS, SIMULATED

ROOT = Path(__file__).resolve().parents[4]
PAGE = (ROOT / "docs" / "how-to" / "cameras.md").read_text(encoding="utf-8")
SECTIONS = {
    match[1]: match[2]
    for match in re.finditer(r"^### `(\w+)`\n(.*?)(?=^##)", PAGE, re.MULTILINE | re.DOTALL)
}
MODELS: dict[str, type[StrictModel]] = {
    "folder": folder.FolderOptions,
    "opencv": opencv.OpencvOptions,
    "genicam": genicam.GenicamOptions,
    "aravis": aravis.AravisOptions,
    "gphoto2": gphoto2.GphotoOptions,
}


def test_every_backend_has_its_row() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", PAGE.split("## One process")[0], re.MULTILINE)
    assert rows == [SIMULATED, *BACKENDS]


@pytest.mark.parametrize("name", MODELS)
def test_every_option_is_explained(name: str) -> None:
    text = SECTIONS[name] + (SECTIONS["genicam"] if name == "aravis" else "")
    explained = {
        key
        for row in re.findall(r"^\| (.*?) \|", text, re.MULTILINE)
        for key in re.findall(r"`(\w+)`", row)
    }
    assert set(keys_of(MODELS[name])) == explained - ({"producers"} if name == "aravis" else set())


@pytest.mark.parametrize("module", [aravis, genicam, gphoto2])
def test_the_page_gives_the_command_the_error_gives(module: object) -> None:
    assert f"`{module.INSTALL}`" in PAGE


def test_the_extras_that_are_named_exist() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    for extra in re.findall(r"rigwright\[(\w+)\]", PAGE):
        assert re.search(rf"^{extra} = \[", project, re.MULTILINE), extra
