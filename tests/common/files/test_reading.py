"""Files that were given: none is waited for, and none is so odd that it ends in a traceback."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from calibration.detection.images import read_picture
from calibration.files.calibrationfile import read_calibration
from calibration.targets.files import read_targets
from common.errors import RigwrightError
from common.files.ownership import MARKER, foreign
from common.files.strict import StrictModel, as_json, parsed, validated
from rig.acquisition.session.index import read_index
from rig.acquisition.session.jsonfiles import read_model
from rig.acquisition.session.storage import Disk
from rig.acquisition.station.stationfile import read_station
from rig.build.mounts.planfile import read_plan
from rig.build.mounts.systemfile import read_system
from rig.catalogue.loader import load_catalogue
from rig.design.designfile import read_design
from rig.design.layoutfile import read_datum
from rig.specification.rigfile import read_rig
from rig.study.resultfile import read_study_result
from rig.study.studyfile import read_study_file
from service.cli.commands.export import _schema
from service.cli.running import require_files
from service.cli.scans import _noted
from service.keys.keyfile import read_keys
from service.server import _certificate

Reader = Callable[[Path], object]


class Lens(StrictModel):
    focal_length_mm: float = 1.0
    name: str = ""


TOML: list[Reader] = [
    read_rig,
    read_station,
    read_study_file,
    read_targets,
    read_system,
    lambda path: load_catalogue([path]),
]
JSON: list[Reader] = [read_design, read_plan, read_calibration, read_study_result, read_datum]
OTHER: list[Reader] = [
    read_picture,
    lambda path: require_files([path]),
    lambda path: _certificate(path, path),
    lambda path: read_keys(path.parent),
    lambda path: read_index(path.parent, Disk()),
]
DEEP = "[" * 100_000
LONG = "1" * 5000


def in_time(read: Reader, path: Path) -> str:
    """What a reader says of a file, one line; fails where it waits."""
    told: list[str] = []

    def work() -> None:
        try:
            read(path)
        except RigwrightError as error:
            told.append(str(error))

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    # Each is done within milliseconds; this is for a busy machine.
    thread.join(20.0)
    assert len(told) == 1 and "\n" not in told[0], read
    return told[0]


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_what_is_no_plain_file_is_told_at_once(tmp_path: Path, kind: str) -> None:
    places = dict.fromkeys((*TOML, *JSON, *OTHER), "file.png")
    places |= {OTHER[-2]: "keys.json", OTHER[-1]: "session.json"}
    for name in {*places.values(), MARKER}:
        if kind == "pipe":
            os.mkfifo(tmp_path / name)
        else:
            (tmp_path / name).symlink_to("/dev/zero")
    for read, name in places.items():
        told = in_time(read, tmp_path / name)
        assert "no layout" in told if read is read_datum else "no plain file" in told
    assert foreign(tmp_path) == "was not written by this program"
    assert _noted(tmp_path / "file.png") is None and _schema(tmp_path / "file.png") == ""


@pytest.mark.parametrize("content", [DEEP, f'{{"a": {LONG}}}'], ids=["deep", "long"])
def test_json_that_cannot_be_read_is_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "file.json"
    path.write_text(content)
    for read in JSON:
        assert path.name in in_time(read, path)
    assert "not JSON" in in_time(lambda p: read_model(Lens, p.read_bytes(), p.name), path)
    assert _noted(path) is None and _schema(path) == ""


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (f"a = {DEEP}", "nested too deeply"),
        (f"a = {LONG}", "more digits than can be read"),
        # A tenth of these take a second, and the time grows as their square.
        (".".join("a" * 100_000) + " = 1", "nested too deeply"),
        (f"a = {{'b' . {' . '.join('a' * 100_000)} = 1}}", "nested too deeply"),
    ],
    ids=["deep", "long", "dotted", "dotted inside"],
)
def test_toml_that_cannot_be_read_is_one_line(tmp_path: Path, content: str, why: str) -> None:
    path = tmp_path / "file.toml"
    path.write_text(content)
    for read in TOML:
        assert why in in_time(read, path)


@pytest.mark.parametrize("value", [10**5000, [[10**5000]]], ids=["plain", "nested"])
def test_a_value_that_cannot_be_shown_is_one_line(tmp_path: Path, value: object) -> None:
    for read in (as_json, validated):
        for key in ("focal_length_mm", "name"):
            told = in_time(lambda _, r=read, k=key: r(Lens, {k: value}, "x.toml"), tmp_path)
            assert told.startswith("x.toml")
    for key in ("focal_length_mm", "name"):
        text = f'{{"{key}": {LONG}}}'
        assert in_time(lambda _, t=text: parsed(Lens, t, "x.json"), tmp_path).startswith("x.json")


def test_a_mark_of_the_byte_order_is_left_out_of_account(tmp_path: Path) -> None:
    for name in ("station.toml", "targets.toml"):
        (tmp_path / name).write_text("\ufeffschema = 1\n", encoding="utf-8")
    for read in TOML:
        assert "Invalid statement" not in in_time(read, tmp_path / "station.toml")
    (tmp_path / "lens.json").write_text('\ufeff{"focal_length_mm": 2.0}', encoding="utf-8")
    assert parsed(Lens, (tmp_path / "lens.json").read_bytes(), "x").focal_length_mm == 2.0
    assert "not JSON" not in in_time(read_design, tmp_path / "lens.json")
