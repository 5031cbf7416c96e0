"""The shape of the project: layers, light imports, nothing that names a machine or a host."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return done.stdout


def test_layers_hold() -> None:
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([linter], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("module", ["solver.design", "solver.quality", "geometry.preparation"])
def test_the_solver_pulls_in_no_server_port_or_image_library(module: str) -> None:
    loaded = python(f"import sys, {module}; print(*sys.modules)").split()
    assert "numpy" in loaded
    for heavy in (
        "fastapi",
        "starlette",
        "serial",
        "cv2",
        "plotly",
        "pydantic",
        "sqlalchemy",
        "typer",
        "trimesh",
    ):
        assert heavy not in loaded


def test_the_command_line_starts_light() -> None:
    loaded = python("import sys, service.cli; print(*sys.modules)").split()
    for heavy in ("numpy", "scipy", "fastapi", "pydantic", "trimesh"):
        assert heavy not in loaded


def tracked_text() -> list[tuple[str, str]]:
    names = subprocess.run(
        ["git", "ls-files"], capture_output=True, text=True, cwd=ROOT, check=False
    )
    if names.returncode != 0:
        pytest.skip("not a git checkout")
    out = []
    for name in names.stdout.split():
        try:
            out.append((name, (ROOT / name).read_text(encoding="utf-8")))
        except UnicodeDecodeError:
            continue
    return out


SETUP_FILES = ("constraints.txt", "pyproject.toml", "Makefile", ".ci/run", ".ci/packages.txt")


def test_setting_up_names_no_host() -> None:
    for name in SETUP_FILES:
        assert "://" not in (ROOT / name).read_text(encoding="utf-8"), name


def test_no_file_names_a_folder_of_some_machine() -> None:
    folder = re.compile(r"(?<![\w./])/(?:work|home|root)/")
    for name, text in tracked_text():
        if name != "tests/test_structure.py":
            assert not folder.search(text), name


def test_no_scan_is_committed() -> None:
    for name, _ in tracked_text():
        assert not name.endswith((".glb", ".obj", ".ply", ".stl", ".3mf")), name
