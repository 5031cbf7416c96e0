"""Printed wedges: closed, printable as they lie, and true to the angles they hold."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from plans import AIMS, Aim, frame, wedge_of

from common.errors import InputError
from rig.build.mounts.settings import turn
from rig.build.mounts.structure import Hole, Wedge
from rig.build.wedges import (
    PrintPart,
    overhang_deg,
    print_part,
    wedge_3mf,
    wedge_corners_mm,
    wedge_mesh,
    wedge_step,
    wedge_stl,
)
from rig.build.wedges.fastenings import room_for
from rig.build.wedges.lettering import words
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
HERE = np.eye(4)
LIMIT_DEG = 60.0 + 1e-3
"""Triangles of 1e-4 mm2 and coordinates good to 1e-9 mm: normals are good to 1e-5."""


def angle(value: float) -> st.SearchStrategy[float]:
    return st.floats(-value, value)


def area_on_plane(mesh: trimesh.Trimesh, point: np.ndarray, normal: np.ndarray) -> float:
    """Area of the triangles that lie in a plane and face along its normal."""
    near = np.abs((mesh.vertices - point) @ normal) < 1e-5
    facing = mesh.face_normals @ normal > 1.0 - 1e-9
    return float(mesh.area_faces[near[mesh.faces].all(axis=1) & facing].sum())


def check(wedge: Wedge) -> tuple[PrintPart, trimesh.Trimesh]:
    part = print_part(wedge, CATALOGUE)
    mesh = wedge_mesh(part)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert overhang_deg(mesh) <= LIMIT_DEG
    assert mesh.bounds[0][2] == pytest.approx(0.0, abs=1e-9)
    hull = trimesh.convex.convex_hull(part.corners_mm)
    assert 0.5 * hull.volume < mesh.volume < 0.99 * hull.volume
    return part, mesh


# The recess behind the camera screw leaves the base up to 24 mm * tan(25 deg) + 5 mm from its
# middle, short of the heads 28 mm from it; seats that lean more do so across the line of holes.
LITTLE = st.tuples(angle(18.0), angle(18.0), angle(180.0))
MUCH = st.tuples(angle(50.0), angle(5.0), st.just(0.0))


@settings(max_examples=8, deadline=None)
@given(LITTLE | MUCH, st.sampled_from(["through", "tapped", "countersunk"]))
def test_every_wedge_is_closed_prints_without_support_and_holds_its_angles(
    turns_deg: tuple[float, float, float], kind: str
) -> None:
    aim = Aim("cam07", 0.0, 0.0, 30.0, turns_deg)
    wedge = wedge_of(aim, HERE, kind=kind)
    part, mesh = check(wedge)
    print_from_rig = np.linalg.inv(part.rig_from_print)
    seat = print_from_rig @ wedge.rig_from_base @ wedge.base_from_seat
    hole = np.pi * (wedge.screw_hole_mm / 2.0) ** 2 * 1.2
    assert area_on_plane(mesh, seat[:3, 3], seat[:3, 2]) > 0.5 * 30.0 * 30.0 - hole
    base = print_from_rig @ wedge.rig_from_base
    assert area_on_plane(mesh, base[:3, 3], -base[:3, 2]) > 0.6 * 72.0 * 34.0
    bed = mesh.area_faces[(mesh.vertices[mesh.faces][:, :, 2] < 1e-6).all(axis=1)].sum()
    assert bed > 150.0, "it stands on a face, not on an edge"


@pytest.mark.parametrize("lean_deg", [60.0, 75.0, 90.0])
def test_a_shelf_on_an_upright_plate(lean_deg: float) -> None:
    seat = frame(turn(np.array([1.0, 0.0, 0.0]), lean_deg), np.array([0.0, -5.0, 40.0]))
    wedge = replace(
        wedge_of(AIMS[2], HERE, kind="through"), base_from_seat=seat, base_size_mm=(72.0, 60.0)
    )
    below = tuple(replace(hole, y_mm=12.0) for hole in wedge.base_holes)
    check(replace(wedge, base_holes=below))


def test_the_name_is_cut_in() -> None:
    wedge = wedge_of(AIMS[0], HERE)
    part = print_part(wedge, CATALOGUE)
    plain = replace(part, cuts=part.cuts[:-1])
    removed = wedge_mesh(plain).volume - wedge_mesh(part).volume
    letters = words("left")
    # Borders of holes, as in an e, run the other way round: their areas count negative.
    area = sum(
        0.5 * np.sum(c[:, 0] * np.roll(c[:, 1], -1) - np.roll(c[:, 0], -1) * c[:, 1])
        for c in letters.contours
    )
    assert removed == pytest.approx(abs(area) * part.letters_mm**2 * 0.6, rel=0.03)
    assert part.letters_mm >= 2.5


def test_a_name_too_long_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match="does not fit") as caught:
        print_part(replace(wedge_of(AIMS[2], HERE), camera="M" * 90), CATALOGUE)
    assert "\n" not in str(caught.value)


def test_letters_that_the_typeface_lacks_become_question_marks() -> None:
    assert words("相").width == words("?").width
    assert words("ü").width == words("u").width


def test_a_steep_seat_is_printed_so_that_its_screw_needs_no_support() -> None:
    """The lightest way up has the outside right, and the camera screw's shoulder facing the bed."""
    lean, roll = np.radians(63.55), np.radians(-24.25)
    seat = np.eye(4)
    seat[:3, :3] = turn(np.array([1.0, 0.0, 0.0]), float(np.degrees(lean))) @ turn(
        np.array([0.0, 0.0, 1.0]), float(np.degrees(-roll))
    )
    seat[:3, 3] = [0.0, -53.0, 40.3]
    holes = tuple(
        Hole(f"{k}", x, y, 5.5, "through", "M5")
        for k, (x, y) in enumerate([(-10.0, 49.0), (-10.0, 74.0), (10.0, 49.0), (10.0, 74.0)], 1)
    )
    wedge = Wedge(
        "steep", "cam06", np.eye(4), seat, (40.0, 30.0), (40.0, 166.0), holes, "stud-1-4-20", 6.8
    )
    part = print_part(wedge, load_catalogue())
    mesh = wedge_mesh(part)
    assert mesh.is_watertight
    assert overhang_deg(mesh) <= 60.0


def test_screws_need_something_to_press_on() -> None:
    wedge = wedge_of(AIMS[2], HERE)
    off = (replace(wedge.base_holes[0], x_mm=36.0), *wedge.base_holes[1:])
    with pytest.raises(InputError, match="nothing to press on"):
        print_part(replace(wedge, base_holes=off), CATALOGUE)


def test_a_seat_below_the_base_is_refused() -> None:
    low = replace(AIMS[2], height_mm=-3.0)
    with pytest.raises(InputError, match="below its base"):
        print_part(wedge_of(low, HERE), CATALOGUE)


def test_rooms_come_from_the_catalogue_and_else_from_the_thread() -> None:
    assert room_for("M5", CATALOGUE).head_diameter_mm == 8.5
    assert room_for("cap-screw-m5", CATALOGUE) == room_for("M5", CATALOGUE)
    # ASME B18.3: a 1/4 inch socket cap screw has a head of 3/8 inch.
    assert room_for("1/4-20", CATALOGUE).head_diameter_mm == pytest.approx(9.525)
    with pytest.raises(InputError, match="M5 or 1/4-20"):
        room_for("quarter", CATALOGUE)


def test_the_body_lies_between_base_and_seat_in_the_rig() -> None:
    wedge = wedge_of(
        AIMS[0], frame(turn(np.array([0.0, 0.0, 1.0]), 30.0), np.array([5.0, 6.0, 7.0]))
    )
    corners = np.column_stack([wedge_corners_mm(wedge), np.ones(len(wedge_corners_mm(wedge)))])
    base = corners @ np.linalg.inv(wedge.rig_from_base).T
    seat = corners @ np.linalg.inv(wedge.rig_from_base @ wedge.base_from_seat).T
    assert base[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert seat[:, 2].max() == pytest.approx(0.0, abs=1e-9)


def test_files_are_in_millimetres_and_the_same_part() -> None:
    part = print_part(wedge_of(AIMS[1], HERE), CATALOGUE)
    mesh = wedge_mesh(part)
    stl = trimesh.load(io.BytesIO(wedge_stl(part)), file_type="stl")
    three = trimesh.load(io.BytesIO(wedge_3mf(part)), file_type="3mf")
    # STL keeps single precision: 1e-7 of 72 mm a coordinate.
    assert stl.is_watertight and stl.volume == pytest.approx(mesh.volume, rel=1e-5)
    assert np.allclose(three.bounds, mesh.bounds, atol=1e-3)
    model = zipfile.ZipFile(io.BytesIO(wedge_3mf(part))).read("3D/3dmodel.model")
    assert b'unit="millimeter"' in model and b'name="wedge-right"' in model


def test_overhang_of_known_solids() -> None:
    box = trimesh.creation.box((10.0, 10.0, 10.0))
    assert overhang_deg(box) == 0.0
    cone = trimesh.creation.cone(radius=10.0, height=10.0, sections=256)
    assert overhang_deg(cone) == 0.0
    # Upside down its wall leans by 45 degrees, less at the middle of a side of 256: 0.01 degree.
    assert overhang_deg(cone, np.array([0.0, 0.0, -1.0])) == pytest.approx(45.0, abs=0.02)
    table = trimesh.util.concatenate(
        [
            trimesh.creation.box((2, 2, 10)),
            trimesh.creation.box(
                (9, 9, 1), trimesh.transformations.translation_matrix((0, 0, 5.5))
            ),
        ]
    )
    assert overhang_deg(table) == pytest.approx(90.0)


def test_step_is_the_same_solid_or_says_how_to_get_it(tmp_path: Path) -> None:
    part = print_part(wedge_of(AIMS[0], HERE, kind="countersunk"), CATALOGUE)
    try:
        import build123d
    except ImportError:
        with pytest.raises(InputError, match=r"pip install rigwright\[cad\]"):
            wedge_step(part)
        return
    path = tmp_path / "wedge.step"
    path.write_bytes(wedge_step(part))
    solid = build123d.import_step(str(path))
    # Holes are true cylinders here and 64-sided in the mesh: 0.2 % of what the holes take away.
    assert solid.volume == pytest.approx(wedge_mesh(part).volume, rel=5e-4)
