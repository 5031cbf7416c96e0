"""``rigwright export``: designs and calibrations for other programs."""

from __future__ import annotations

from pathlib import Path

import pytest
from calibrations import small_reference
from typer.testing import CliRunner

from calibration.files import CalibrationRecord, write_calibration
from service.cli import app


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("calibrated")
    record = CalibrationRecord("small", "2026-11-01T00:00:00+00:00", small_reference())
    write_calibration(place / "calibration.json", record)
    return place


def export(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["export", *map(str, words)])
    return done.exit_code, done.stdout, done.stderr


@pytest.mark.parametrize("given", [".", "calibration.json"])
def test_a_calibration_is_exported_from_its_folder_or_file(
    folder: Path, tmp_path: Path, given: str
) -> None:
    out = tmp_path / "colmap"
    code, told, wrong = export(folder / given, "--format", "colmap-text", "--out", out)
    assert code == 0, wrong
    cameras = (out / "cameras.txt").read_text()
    assert str(out / "cameras.txt") in told
    for camera in small_reference().cameras:
        assert f"{camera.interior.focal_length_px:.6f}"[:9] in cameras


def test_what_is_neither_is_told(tmp_path: Path) -> None:
    code, _, wrong = export(tmp_path, "--format", "colmap-text", "--out", tmp_path / "out")
    assert code == 2
    assert "holds neither calibration.json nor design.json; give what" in wrong
    assert export(tmp_path / "none.json", "--format", "colmap-text", "--out", "x")[0] == 2


def test_a_folder_with_files_is_left(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert export(folder, "--format", "colmap-text", "--out", tmp_path)[0] == 2
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
