"""Clashes: everything that is too near is told once, what belongs together is left alone."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mounted import placed
from rigs import face, face_limits

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.clashes import ROUNDING_MM, Site, find_clashes, pairs, required_mm
from rig.build.mounts.solids import camera_solids
from rig.build.mounts.structure import Solid
from rig.build.mounts.surroundings import Surroundings, Zone
from rig.solids.convex import box_corners, signed_distance

FAR = np.array([0.0, 3000.0, 0.0])


def around(**changes: object) -> Surroundings:
    limits = replace(face_limits(), body_clearance_mm=5.0, sight_line_clearance_mm=10.0)
    values = {"zones": (), "floor_z_mm": -1200.0, "clearance_mm": 2.0} | changes
    return Surroundings(face(50, 100), limits, **values)


def cube(owner: str, at: object, size: float = 10.0, kind: str = "member") -> Solid:
    centre = FAR + np.asarray(at, dtype=np.float64)
    return Solid(owner, kind, box_corners(np.full(3, size), centre))


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000))
def test_every_pair_that_is_too_near_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solids = tuple(cube(f"m{k}", rng.uniform(-25.0, 25.0, 3)) for k in range(9))
    joined = pairs(("m0", "m1"), ("m3", "m2"))
    found = find_clashes(solids, joined, (), around())
    wanted = {
        (a.owner, b.owner)
        for a, b in combinations(solids, 2)
        if signed_distance(a.corners_mm, b.corners_mm) < 2.0 - ROUNDING_MM
        and {a.owner, b.owner} not in ({"m0", "m1"}, {"m2", "m3"})
    }
    assert {(c.one, c.other) for c in found} == wanted
    for clash in found:
        a, b = (next(s for s in solids if s.owner == name) for name in (clash.one, clash.other))
        assert clash.kind == "solid" and clash.required_mm == 2.0
        assert clash.clearance_mm <= signed_distance(a.corners_mm, b.corners_mm) + 1e-6


def test_of_many_between_the_same_two_the_worst_is_told() -> None:
    solids = (
        cube("b", [0, 0, 0]),
        cube("a", [9, 0, 0]),
        cube("a", [6, 0, 0]),
        cube("b", [0, 1, 0]),
    )
    (clash,) = find_clashes(solids, pairs(), (), around())
    assert (clash.one, clash.other) == ("a", "b")
    # Centres 6 mm apart, cubes of 10: 4 mm deep.
    assert clash.clearance_mm == pytest.approx(-4.0, abs=1e-6)


def test_parts_of_one_owner_and_joined_ones_belong_together() -> None:
    scene = around()
    one, other = cube("a", [0, 0, 0]), cube("b", [5, 0, 0])
    assert required_mm(one, one, pairs(), scene) is None
    assert required_mm(one, other, pairs(("b", "a")), scene) is None
    assert required_mm(one, other, pairs(("a", "c")), scene) == 2.0


@pytest.mark.parametrize(
    ("kinds", "gap"),
    [
        (("camera", "camera"), 5.0),
        (("camera", "lens"), 5.0),
        (("camera", "cable"), 2.0),
        (("lens", "head"), 2.0),
        (("member", "member"), 2.0),
    ],
)
def test_cameras_keep_the_gap_of_the_limits(kinds: tuple[str, str], gap: float) -> None:
    one, other = cube("a", [0, 0, 0], kind=kinds[0]), cube("b", [50, 0, 0], kind=kinds[1])
    assert required_mm(one, other, pairs(), around()) == gap
    for off, count in ((gap - 0.1, 1), (gap + 0.1, 0)):
        moved = Solid("b", kinds[1], one.corners_mm + (10.0 + off) * np.eye(3)[0])
        assert len(find_clashes((one, moved), pairs(), (), around())) == count


def looking() -> RigCamera:
    """A camera a metre before the face, which lies about the origin, its foremost point at -95."""
    return placed("eye", Pose.looking_at(np.array([0.0, -1000.0, 0.0]), np.zeros(3)))


@pytest.mark.parametrize(
    ("centre", "count"),
    [
        ([0.0, -500.0, 0.0], 1),  # in the middle of the view
        ([0.0, -1300.0, 0.0], 0),  # behind the camera
        ([250.0, -500.0, 0.0], 0),  # beside the view, which is 75 mm wide at the face
        ([0.0, -500.0, -180.0], 0),
    ],
)
def test_what_stands_in_a_view_is_told(centre: list[float], count: int) -> None:
    post = Solid("post", "member", box_corners(np.full(3, 20.0), np.array(centre)))
    camera = looking()
    found = find_clashes((*camera_solids(camera), post), pairs(), (camera,), around())
    assert [(c.kind, c.one, c.other) for c in found] == [("view", "eye", "post")] * count


def test_a_camera_does_not_stand_in_its_own_view_but_in_that_of_another() -> None:
    camera = looking()
    assert find_clashes(camera_solids(camera), pairs(), (camera,), around()) == ()
    other = placed("other", Pose.looking_at(np.array([0.0, -500.0, 0.0]), np.zeros(3)))
    solids = (*camera_solids(camera), *camera_solids(other))
    found = find_clashes(solids, pairs(), (camera, other), around())
    assert {(c.kind, c.one, c.other) for c in found} == {("view", "eye", "other")}


def test_a_zone_is_left_free() -> None:
    zone = Zone("door", FAR - 20.0, FAR + 20.0)
    scene = around(zones=(zone,))
    touching, inside = cube("a", [25.0, 0, 0]), cube("b", [0, 24.0, 0])
    found = find_clashes((touching, inside), pairs(), (), scene)
    assert [(c.one, c.other, c.required_mm) for c in found] == [("door", "b", 0.0)]
    assert found[0].clearance_mm == pytest.approx(-1.0, abs=1e-6)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_a_site_counts_what_a_part_would_bring(seed: int) -> None:
    rng = np.random.default_rng(seed)
    standing = tuple(cube(f"m{k}", rng.uniform(-30.0, 30.0, 3)) for k in range(6))
    site = Site(standing[:3], (), around(), 4.0)
    site.add(standing[3:])
    part = (cube("new", rng.uniform(-30.0, 30.0, 3)),)
    # The site keeps 4 mm of room beside the 2 mm that a finished rig needs.
    wanted = sum(signed_distance(part[0].corners_mm, s.corners_mm) < 6.0 for s in standing)
    assert site.clashes(part, pairs()) == wanted
    assert site.clashes(part, pairs(*(("new", s.owner) for s in standing))) == 0


def test_a_site_counts_views_and_zones_too() -> None:
    camera = looking()
    scene = around(zones=(Zone("door", FAR - 20.0, FAR + 20.0),))
    site = Site(camera_solids(camera), (camera,), scene, 0.0)
    in_view = Solid("a", "member", box_corners(np.full(3, 20.0), np.array([0.0, -500.0, 0.0])))
    assert site.clashes((in_view,), pairs()) == 1
    assert site.clashes((cube("b", [0, 0, 0]),), pairs()) == 1
    assert site.clashes((in_view, cube("b", [0, 0, 0])), pairs()) == 2
