"""``rigwright catalogue`` and ``rigwright export``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from service_helpers import ROOT, rigwright_here

from geometry.exchange import FORMATS

DESIGN = ROOT / "examples" / "station" / "design.json"


def test_the_catalogue_is_searched_and_tells_its_sources() -> None:
    found = rigwright_here(
        "catalogue", "--table", "lens", "--where", "focal_length_mm=50", "--json"
    )
    assert found.returncode == 0, found.stderr
    lenses = json.loads(found.stdout)["parts"]
    assert lenses
    assert all(lens["focal_length_mm"] == 50.0 for lens in lenses)
    shown = rigwright_here("catalogue", "--show", lenses[0]["id"], "--json")
    figures = json.loads(shown.stdout)["figures"]
    assert figures["focal_length_mm"]["value"] == 50.0
    assert all(figure["source"] for figure in figures.values())


def test_parts_of_ones_own_are_laid_over(tmp_path: Path) -> None:
    parts = tmp_path / "mine.toml"
    parts.write_text('schema = "rigwright.catalogue/1"\n\n[camera.mine]\nnam = "Mine"\n')
    wrong = rigwright_here("catalogue", "--parts", parts)
    assert wrong.returncode == 2
    (line,) = wrong.stderr.splitlines()
    assert line.startswith("rigwright: ")


QUICK = ("colmap-text", "gltf")
"""What a process is started for in every run; the writers themselves have tests of their own."""


@pytest.mark.parametrize(
    "form",
    [pytest.param(f, marks=[] if f in QUICK else [pytest.mark.slow]) for f in sorted(FORMATS)],
)
def test_every_format_is_written(tmp_path: Path, form: str) -> None:
    done = rigwright_here("export", DESIGN, "--format", form, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    written = [Path(line) for line in done.stdout.splitlines()]
    assert written
    assert all(path.stat().st_size > 0 for path in written if "points3D" not in path.name)
    again = rigwright_here("export", DESIGN, "--format", form, "--out", tmp_path / "out")
    assert again.returncode == 2


def test_formats_are_listed_and_misspelt_ones_told(tmp_path: Path) -> None:
    listed = rigwright_here("export", DESIGN)
    assert all(form in listed.stdout for form in FORMATS)
    wrong = rigwright_here("export", DESIGN, "--format", "colmpa", "--out", tmp_path / "out")
    assert wrong.returncode == 2
    assert "did you mean colmap-text" in wrong.stderr
    assert not (tmp_path / "out").exists()
