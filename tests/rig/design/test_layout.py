"""The mount layout: places a builder can check by hand, and what comes too close."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from geometry.camera import RigCamera
from geometry.frames import Pose, rotation_from_pan_tilt_roll
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from rig.design.layout import Layout, make_layout
from rig.design.layoutfile import COLUMNS, layout_csv, layout_document
from rig.specification.examples import example_rig
from solver.limits import Limits
from solver.result import Design


@pytest.fixture(scope="module")
def plate() -> Subject:
    """A small square plate at the origin that faces the cameras; its foremost point is known."""
    x, z = np.meshgrid(np.linspace(-50, 50, 11), np.linspace(-50, 50, 11))
    y = np.where((x == 0) & (z == 0), -20.0, 0.0)
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    surface = SurfacePoints(points, np.tile([0.0, -1.0, 0.0], (len(points), 1)))
    return Subject(surface, surface, Occluder.none())


def camera_at(
    name: str, place: list[float], pan_tilt_roll: tuple[float, float, float] = (0, 0, 0)
) -> RigCamera:
    pose = Pose(np.array(place, dtype=float), rotation_from_pan_tilt_roll(np.array(pan_tilt_roll)))
    return RigCamera(name, example_rig("face").camera, pose, 600.0)


def layout_of(*cameras: RigCamera, subject: Subject, **limits: object) -> Layout:
    return make_layout(cameras, subject, replace(Limits(), **limits))


def test_one_level_camera_by_hand(plate: Subject) -> None:
    layout = layout_of(camera_at("one", [10.0, -600.0, 5.0]), subject=plate)
    (one,) = layout.placements
    assert layout.datum_rig_mm.tolist() == [0.0, -20.0, 0.0]
    # The lens reaches from 12.5 mm behind the projection centre to 12.5 mm before it; the body
    # (32 mm deep, 45 mm high) stands behind it with its thread 28.5 mm back and 22.5 mm down.
    assert np.allclose(one.lens_front_mm, [10.0, -587.5, 5.0])
    assert np.allclose(one.mount_mm, [10.0, -628.5, -17.5])
    assert np.allclose(one.mount_axis, [0.0, 0.0, -1.0])
    assert np.allclose(one.from_datum_mm, [10.0, 608.5, -17.5])
    assert one.tape_mm == pytest.approx(np.sqrt(10.0**2 + 567.5**2 + 5.0**2))
    assert np.allclose(one.body_corners_mm.min(axis=0), [-21.0, -644.5, -17.5])
    assert np.allclose(one.body_corners_mm.max(axis=0), [41.0, -612.5, 27.5])
    assert np.allclose(layout.envelope_size_mm, [62.0, 57.0, 45.0])
    assert one.nearest_body is None and one.nearest_to_view is None
    assert layout.collisions == ()


def test_pan_tilt_roll_are_what_was_set(plate: Subject) -> None:
    turned = camera_at("one", [-150.0, -600.0, 80.0], (14.0, -7.5, 3.0))
    (one,) = layout_of(turned, subject=plate).placements
    assert np.allclose(one.pan_tilt_roll_deg, [14.0, -7.5, 3.0])
    assert one.mount_axis[2] < -0.9, "the thread still points down"


def test_neighbours_side_by_side(plate: Subject) -> None:
    row = [
        camera_at(name, [x, -600.0, 0.0]) for name, x in (("a", -100.0), ("b", 0.0), ("c", 70.0))
    ]
    layout = layout_of(*row, subject=plate, body_clearance_mm=10.0)
    gaps = layout.clearance_mm
    assert gaps[0, 1] == pytest.approx(38.0) and gaps[1, 2] == pytest.approx(8.0)
    assert np.isinf(np.diag(gaps)).all() and (gaps == gaps.T).all()
    nearest = layout.placements[1].nearest_body
    assert nearest is not None and nearest.name == "c"
    (collision,) = layout.collisions
    assert (collision.kind, collision.name, collision.other) == ("body", "b", "c")
    assert collision.clearance_mm == pytest.approx(8.0) and collision.required_mm == 10.0


def test_lenses_collide_too(plate: Subject) -> None:
    # Two cameras that look at each other, lens fronts 5 mm apart, bodies 55 mm apart.
    one = camera_at("one", [0.0, -600.0, 0.0])
    other = camera_at("other", [0.0, -570.0, 0.0], (180.0, 0.0, 0.0))
    layout = layout_of(one, other, subject=plate)
    assert layout.clearance_mm[0, 1] == pytest.approx(5.0)


def test_overlap_is_listed_even_when_the_limit_is_off(plate: Subject) -> None:
    pair = [camera_at("a", [0.0, -600.0, 0.0]), camera_at("b", [52.0, -600.0, 0.0])]
    layout = layout_of(*pair, subject=plate, body_clearance_mm=None)
    assert layout.clearance_mm[0, 1] == pytest.approx(-10.0)
    assert [c.kind for c in layout.collisions] == ["body"]


def test_a_body_in_the_view_is_found(plate: Subject) -> None:
    behind, front = camera_at("behind", [0.0, -900.0, 0.0]), camera_at("front", [0.0, -500.0, 0.0])
    layout = layout_of(behind, front, subject=plate)
    assert [(c.name, c.other) for c in layout.collisions if c.kind == "view"] == [
        ("behind", "front")
    ]


def test_the_gap_between_a_view_and_a_body_by_hand(plate: Subject) -> None:
    behind, aside = (
        camera_at("behind", [0.0, -900.0, 0.0]),
        camera_at("aside", [300.0, -500.0, 0.0]),
    )
    nearest = layout_of(behind, aside, subject=plate).placements[0].nearest_to_view
    # From the body's corner (269, -512.5) to the view's side from (0, -900) to (50, 0).
    expected = (900.0 * 269.0 - 50.0 * 387.5) / np.hypot(900.0, 50.0)
    assert nearest is not None and nearest.clearance_mm == pytest.approx(expected)


def test_what_a_camera_does_not_see_is_not_its_view(plate: Subject) -> None:
    away = camera_at("away", [0.0, -900.0, 0.0], (180.0, 0.0, 0.0))
    front = camera_at("front", [0.0, -500.0, 0.0])
    layout = layout_of(away, front, subject=plate)
    assert layout.placements[0].nearest_to_view is None
    assert not [c for c in layout.collisions if c.name == "away"]


def test_clearances_of_a_ring_agree_with_points_on_the_bodies(
    design: Design, subject: Subject
) -> None:
    """Points drawn inside two bodies are never nearer than the clearance, and come close to it."""
    layout = make_layout(design.cameras, subject, design.limits)
    rng = np.random.default_rng(0)
    clouds = []
    for placement in layout.placements[:2]:
        corners = placement.body_corners_mm
        weights = rng.dirichlet(np.full(8, 0.08), 3000)
        clouds.append(weights @ corners)
    from scipy.spatial import cKDTree

    nearest = cKDTree(clouds[0]).query(clouds[1])[0].min()
    assert layout.clearance_mm[0, 1] <= nearest
    assert nearest - layout.clearance_mm[0, 1] < 10.0


def test_files_say_the_same(design: Design, subject: Subject) -> None:
    layout = make_layout(design.cameras, subject, design.limits)
    document = json.loads(json.dumps(layout_document(layout), allow_nan=False))
    assert document["schema"] == "rigwright.layout/1"
    rows = list(csv.DictReader(io.StringIO(layout_csv(layout))))
    assert tuple(rows[0]) == COLUMNS
    assert [row["name"] for row in rows] == [c["name"] for c in document["cameras"]]
    for row, camera, placement in zip(rows, document["cameras"], layout.placements, strict=True):
        assert float(row["back_mm"]) == pytest.approx(camera["from_datum"]["back_mm"], abs=0.0051)
        assert float(row["tilt_deg"]) == pytest.approx(placement.pan_tilt_roll_deg[1], abs=0.0051)
        assert camera["body"]["corners_mm"][7] == pytest.approx(
            placement.body_corners_mm[7], abs=6e-4
        )
        assert row["nearest_body"] == camera["nearest_body"]["name"]
    assert document["body_clearance"]["clearance_mm"][0][0] is None
