"""The design folder is written whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from common.errors import ConflictError, InputError
from geometry.preparation import PreparedSubject
from geometry.subject import Subject
from rig.design.layout import Layout, make_layout
from rig.report.designfolder import (
    FILE_NAMES,
    MEDIA_TYPES,
    check_design_folder,
    points_csv,
    write_design_folder,
)
from rig.specification.examples import example_rig
from solver.result import Design


@pytest.fixture(scope="module")
def layout(design: Design, subject: Subject) -> Layout:
    return make_layout(design.cameras, subject, design.limits)


@pytest.fixture(scope="module")
def written(
    tmp_path_factory: pytest.TempPathFactory,
    design: Design,
    layout: Layout,
    prepared: PreparedSubject,
) -> dict[str, Path]:
    """The files of a design, written into a folder that was not there; not to be changed."""
    out = tmp_path_factory.mktemp("written") / "deep" / "out"
    return write_design_folder(out, design, layout, prepared, example_rig("face"), "head.glb")


def test_all_files_are_written(written: dict[str, Path]) -> None:
    paths, out = written, written["design.json"].parent
    assert tuple(paths) == FILE_NAMES == tuple(MEDIA_TYPES)
    assert sorted(p.name for p in out.iterdir()) == sorted(FILE_NAMES)
    assert [p.name for p in out.parent.iterdir()] == ["out"], "nothing half-written stays"
    document = json.loads(paths["design.json"].read_text())
    assert document["scan"]["name"] == "head.glb" and len(document["cameras"]) == 7
    assert paths["scene.glb"].read_bytes()[:4] == b"glTF"
    assert paths["report.html"].stat().st_size < 8_000_000


def test_the_same_design_gives_the_same_bytes(
    tmp_path: Path,
    written: dict[str, Path],
    design: Design,
    layout: Layout,
    prepared: PreparedSubject,
) -> None:
    spec = example_rig("face")
    other = write_design_folder(tmp_path / "b", design, layout, prepared, spec, "head.glb")
    for name in FILE_NAMES:
        assert written[name].read_bytes() == other[name].read_bytes(), name


def test_a_former_design_is_replaced_and_other_files_are_not(
    tmp_path: Path,
    written: dict[str, Path],
    design: Design,
    layout: Layout,
    prepared: PreparedSubject,
) -> None:
    out, spec = tmp_path / "out", example_rig("face")
    shutil.copytree(written["design.json"].parent, out)
    (out / "report.html").write_text("old")
    write_design_folder(out, design, layout, prepared, spec)
    assert (out / "report.html").stat().st_size > 1000
    (out / "thesis.tex").write_text("mine")
    with pytest.raises(ConflictError, match="holds other files"):
        write_design_folder(out, design, layout, prepared, spec)
    assert (out / "thesis.tex").read_text() == "mine"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_fault_on_the_way_leaves_nothing(
    tmp_path: Path, design: Design, layout: Layout, prepared: PreparedSubject
) -> None:
    # A NaN in a place that JSON cannot hold is found while the folder is being written.
    bad = replace(design, solver=replace(design.solver, seconds=float("nan")))
    with pytest.raises(ValueError, match="JSON"):
        write_design_folder(tmp_path / "out", bad, layout, prepared, example_rig("face"))
    assert list(tmp_path.iterdir()) == []


def test_places_that_cannot_be_written(
    tmp_path: Path, design: Design, layout: Layout, prepared: PreparedSubject
) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(ConflictError, match="is not a folder"):
        check_design_folder(tmp_path / "file")
    with pytest.raises(InputError, match="cannot write into"):
        write_design_folder(
            tmp_path / "file" / "out", design, layout, prepared, example_rig("face")
        )


def test_points_in_a_table(design: Design) -> None:
    table = design.quality.points
    rows = list(csv.DictReader(io.StringIO(points_csv(table, design.start_quality.points))))
    assert len(rows) == len(table.points)
    assert float(rows[5]["sigma_mm"]) == pytest.approx(table.sigma_mm[5], rel=1e-5)
    assert int(rows[5]["views"]) == table.views[5]
    assert float(rows[5]["x_mm"]) == pytest.approx(table.points.points_mm[5, 0], abs=6e-4)
