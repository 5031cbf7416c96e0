"""Units and axes: inferred from the format and from what a head looks like."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scanfiles import plain_head, real_head_path

from common.errors import InputError
from geometry.axes import DIRECTIONS, Axes
from geometry.reading import read_scan
from geometry.sampling import spread
from geometry.scan import Scan
from geometry.scanoptions import ScanOptions
from geometry.standing import stand
from geometry.units import MM_PER_UNIT, find_head

ALL_AXES = [
    Axes(up, front)
    for up, front in itertools.product(DIRECTIONS, DIRECTIONS)
    if DIRECTIONS[up] @ DIRECTIONS[front] == 0.0
]


def texts_of(scan: Scan) -> str:
    return " / ".join(note.text for note in scan.notes)


def real_head() -> Scan:
    path = real_head_path()
    if path is None:
        pytest.skip("the real head scan is absent")
    return read_scan(path)


each_axes = pytest.mark.parametrize(
    "axes",
    [
        pytest.param(a, id=f"{a.up}{a.front}", marks=[pytest.mark.slow] if k % 12 else [])
        for k, a in enumerate(ALL_AXES)
    ],
)
"""All 24; two of them in every run."""


def test_there_are_24_axes_and_each_is_a_rotation() -> None:
    assert len(ALL_AXES) == 24
    for axes in ALL_AXES:
        assert np.linalg.det(axes.rotation_file_to_rig) == pytest.approx(1.0)
        assert axes.rotation_file_to_rig @ DIRECTIONS[axes.up] == pytest.approx([0, 0, 1])
        assert axes.rotation_file_to_rig @ DIRECTIONS[axes.front] == pytest.approx([0, -1, 0])


@each_axes
def test_axes_of_a_plain_head_are_found(axes: Axes) -> None:
    head = plain_head()
    samples = spread(head.vertices @ axes.rotation_file_to_rig, head.faces, head.vertex_normals)
    standing = stand(samples, "STL", None, ScanOptions())
    np.testing.assert_allclose(standing.rotation_file_to_rig, axes.rotation_file_to_rig)


@pytest.mark.slow
@pytest.mark.real_scan
@each_axes
def test_axes_and_units_of_the_real_head_are_found(tmp_path: Path, axes: Axes) -> None:
    upright = real_head()
    extension = "stl" if axes.up < axes.front else "obj"
    turned = trimesh.Trimesh(upright.vertices_mm @ axes.rotation_file_to_rig, upright.faces)
    turned.export(tmp_path / f"head.{extension}")
    scan = read_scan(tmp_path / f"head.{extension}")
    assert f"{axes.up} is up, {axes.front} is front" in texts_of(scan)
    assert "millimetres" in texts_of(scan)
    # float32 in STL, eight decimals in OBJ: 1e-4 mm on 220 mm.
    assert scan.extents_mm == pytest.approx(upright.extents_mm, abs=1e-3)


@pytest.mark.slow
@pytest.mark.real_scan
def test_the_real_head_gets_the_size_of_a_head() -> None:
    scan = real_head()
    assert len(scan.vertices_mm) == 8844
    mesh = trimesh.Trimesh(scan.vertices_mm, scan.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0.0
    assert "240 mm tall" in texts_of(scan)
    # Men's heads are 140 to 170 mm broad above the ears; 110 mm above the neck is there.
    high = scan.vertices_mm[:, 2].max()
    level = scan.vertices_mm[np.abs(scan.vertices_mm[:, 2] - (high - 80.0)) < 5.0]
    assert 140.0 < np.ptp(level[:, 0]) < 170.0


@pytest.mark.slow
@pytest.mark.real_scan
@pytest.mark.parametrize("tall", [True, False])
def test_the_head_part_ends_at_the_neck_only_with_shoulders(tall: bool) -> None:
    samples = real_head().vertices_mm
    head = find_head(samples if tall else samples[samples[:, 2] > -40.0])
    assert head.has_shoulders is tall
    assert head.crown - head.lower_end == pytest.approx(240.0, abs=8.0)


@pytest.mark.parametrize(
    "unit",
    [pytest.param(u, marks=() if u == "inch" else pytest.mark.slow) for u in sorted(MM_PER_UNIT)],
)
def test_units_follow_from_the_size(tmp_path: Path, unit: str) -> None:
    head = plain_head()
    head.apply_scale(1.0 / MM_PER_UNIT[unit])
    head.export(tmp_path / "head.ply")
    scan = read_scan(tmp_path / "head.ply")
    assert scan.extents_mm == pytest.approx(plain_head().extents, abs=1e-2)
    assert "from the size of the face" in texts_of(scan)


def test_gltf_is_metres_with_y_up(tmp_path: Path) -> None:
    head = plain_head()
    head.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2.0, [1, 0, 0]))
    head.apply_scale(1e-3)
    head.export(tmp_path / "head.glb")
    scan = read_scan(tmp_path / "head.glb")
    assert scan.extents_mm == pytest.approx(plain_head().extents, abs=1e-2)
    assert scan.vertices_mm[:, 1].min() == pytest.approx(plain_head().bounds[0, 1], abs=1e-2)
    assert "metres" in texts_of(scan)
    assert "glTF" in texts_of(scan)


def test_gltf_with_other_axes_than_prescribed_is_turned_as_its_face(tmp_path: Path) -> None:
    head = plain_head()
    head.apply_scale(1e-3)
    head.export(tmp_path / "head.glb")
    scan = read_scan(tmp_path / "head.glb")
    assert "+z is up, -y is front, from the shape of the face" in texts_of(scan)
    assert scan.extents_mm == pytest.approx(plain_head().extents, abs=1e-2)


@pytest.mark.slow
def test_impossible_sizes_are_scaled_with_a_warning(tmp_path: Path) -> None:
    head = plain_head()
    head.apply_scale(30.0)
    head.export(tmp_path / "head.ply")
    scan = read_scan(tmp_path / "head.ply")
    # A whole head is scaled to 240 mm; its own 254 mm are within what faces tell.
    assert scan.extents_mm[2] == pytest.approx(240.0, abs=1.0)
    assert [n.kind for n in scan.notes if "240 mm" in n.text] == ["warning"]


def test_doubtful_units_are_obeyed_with_a_warning(tmp_path: Path) -> None:
    plain_head().export(tmp_path / "head.ply")
    scan = read_scan(tmp_path / "head.ply", ScanOptions(units="cm"))
    assert scan.extents_mm == pytest.approx(10.0 * plain_head().extents, rel=1e-4)
    assert [n.kind for n in scan.notes if "check the units" in n.text] == ["warning"]


@pytest.mark.parametrize(("units", "size"), [("m", 1.0), ("inch", 1.0), ("mm", 1e-3)])
def test_impossible_units_are_refused(tmp_path: Path, units: str, size: float) -> None:
    head = plain_head()
    head.apply_scale(size)
    head.export(tmp_path / "head.ply")
    with pytest.raises(InputError, match="give the units") as caught:
        read_scan(tmp_path / "head.ply", ScanOptions(units=units))
    assert caught.value.detail == "scan-size"


def test_a_scale_overrides_units(tmp_path: Path) -> None:
    plain_head().export(tmp_path / "head.ply")
    scan = read_scan(tmp_path / "head.ply", ScanOptions(units="m", scale=1.1))
    assert scan.extents_mm == pytest.approx(1.1 * plain_head().extents, rel=1e-4)


@pytest.mark.parametrize(
    "solid",
    ["sphere", "box", "cylinder"],
)
@pytest.mark.slow
def test_a_shape_without_a_face_asks_for_axes(tmp_path: Path, solid: str) -> None:
    shapes = {
        "sphere": trimesh.creation.icosphere(subdivisions=4, radius=120.0),
        "box": trimesh.creation.box(extents=(150.0, 200.0, 250.0)),
        "cylinder": trimesh.creation.cylinder(radius=80.0, height=240.0),
    }
    shapes[solid].export(tmp_path / "thing.stl")
    with pytest.raises(InputError) as caught:
        read_scan(tmp_path / "thing.stl")
    assert caught.value.detail == "axes-unclear"
    assert "up" in caught.value.remedy


def test_one_given_direction_narrows_the_choice() -> None:
    head = plain_head()
    samples = spread(head.vertices, head.faces, head.vertex_normals)
    for options in (ScanOptions(up="+z"), ScanOptions(front="-y")):
        found = stand(samples, "STL", None, options).rotation_file_to_rig
        np.testing.assert_allclose(found, np.eye(3), atol=1e-12)
