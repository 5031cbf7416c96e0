"""Printed wedges can be put together: camera onto wedge first, wedge onto its post from above."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from rigs import compact_camera, face, face_cameras, face_limits

from common.errors import InputError
from geometry.camera import Body, RigCamera
from geometry.frames import Pose
from rig.build.mounts.clashes import find_clashes
from rig.build.mounts.making import make_plan
from rig.build.mounts.settings import turn
from rig.build.mounts.solids import carried
from rig.build.mounts.steps import assembly_steps
from rig.build.mounts.structure import Wedge
from rig.build.mounts.surroundings import Surroundings, head_entry
from rig.build.mounts.systemfile import parse_system
from rig.build.mounts.systems.base import Built
from rig.build.wedges import overhang_deg, print_part, wedge_mesh
from rig.build.wedges.fastenings import room_for
from rig.catalogue import load_catalogue
from rig.solids.convex import box_corners, cylinder_corners, signed_distance

CATALOGUE = load_catalogue()
KEY_MM = 1000.0
LIMIT_DEG = 60.0 + 1e-3
LARGE = Body([140.0, 100.0, 75.0], [5.0, 8.0, -60.0], 78.0, 90.0, [5.0, 58.0, -60.0])
"""A single-lens reflex camera whose thread is not under the middle of its body."""


@cache
def around() -> Surroundings:
    return Surroundings(face(), face_limits(), (head_entry(face(), -1400.0),), -1400.0, 2.0)


def rolled(cameras: tuple[RigCamera, ...], body: Body | None = None) -> tuple[RigCamera, ...]:
    """The cameras rolled by odd angles, with another body where one is given."""
    target, out = face().design_points.centroid_mm, []
    for k, camera in enumerate(cameras):
        pose = Pose.looking_at(camera.pose.position_rig_mm, target, 47.0 * k)
        kind = compact_camera(body=body) if body else camera.camera
        out.append(RigCamera(camera.name, kind, pose, camera.focus_distance_mm))
    return tuple(out)


def built(cameras: tuple[RigCamera, ...]) -> Built:
    return parse_system('kind = "plate"').system.hold(cameras, around()).build()


def in_the_way(wedge: Wedge, camera: RigCamera) -> list[np.ndarray]:
    """Body, lens and seat in the frame of the wedge's base."""
    body, base_from_rig = camera.camera.body, np.linalg.inv(wedge.rig_from_base)
    box = box_corners(body.size_mm, body.centre_camera_mm)
    front = body.front_z_mm
    lens = cylinder_corners(body.lens_diameter_mm, front, front + body.lens_length_mm)
    seat = box_corners(np.array([*wedge.seat_size_mm, 0.0]), np.zeros(3))
    return [
        *(carried(base_from_rig, camera.pose.to_rig(corners)) for corners in (box, lens)),
        carried(wedge.base_from_seat, seat),
    ]


def check_keys(made: Built) -> None:
    for wedge, mount in zip(made.structure.wedges, made.mounts, strict=True):
        assert len(wedge.base_holes) == 4
        for hole in wedge.base_holes:
            head = room_for(hole.thread, CATALOGUE).head_diameter_mm
            key = cylinder_corners(head, 6.0, KEY_MM) + np.array([hole.x_mm, hole.y_mm, 0.0])
            for solid in in_the_way(wedge, mount.camera):
                assert signed_distance(key, solid) > 0.0, (mount.name, hole.label)


@pytest.mark.parametrize("count", [4, 5, 6])
def test_every_base_screw_is_reached_past_camera_lens_and_seat(count: int) -> None:
    check_keys(built(face_cameras(face(), count)))


@pytest.mark.parametrize("body", [None, LARGE])
def test_rolled_and_large_cameras_leave_the_screws_free_as_well(body: Body | None) -> None:
    made = built(rolled(face_cameras(face(), 5), body))
    check_keys(made)
    for wedge in made.structure.wedges:
        print_part(wedge, CATALOGUE)


def test_the_holes_lie_in_the_slots_and_the_base_on_its_post() -> None:
    made = built(rolled(face_cameras(face(), 4)))
    posts = {m.id: m for m in made.structure.members}
    for wedge in made.structure.wedges:
        post = posts[f"{wedge.camera} post"]
        assert {abs(hole.x_mm) for hole in wedge.base_holes} == {10.0}
        half = wedge.base_size_mm[1] / 2.0
        assert all(abs(hole.y_mm) < half for hole in wedge.base_holes)
        ends = carried(wedge.rig_from_base, np.array([[0.0, -half, 0.0], [0.0, half, 0.0]]))
        along = (ends - post.axis_mm[0]) @ (post.axis_mm[1] - post.axis_mm[0]) / post.length_mm
        assert along[0] >= 0.0 and along[1] <= post.length_mm + 1e-9
        beside = (
            ends
            - post.axis_mm[0]
            - np.outer(along, post.axis_mm[1] - post.axis_mm[0]) / (post.length_mm)
        )
        # The base lies on the wide side of a 2040, 10 mm from the post's axis.
        assert np.allclose(np.linalg.norm(beside, axis=1), 10.0)


def leaning(seed: int, lean_deg: float) -> RigCamera:
    """A camera that looks ``lean_deg`` off the plate's normal, anyhow rolled."""
    rng = np.random.default_rng(seed)
    around_deg, roll = rng.uniform(-180.0, 180.0, 2)
    aside = turn(np.array([0.0, 1.0, 0.0]), around_deg) @ np.array([1.0, 0.0, 0.0])
    way = np.cos(np.radians(lean_deg)) * np.array([0.0, 1.0, 0.0])
    way = way + np.sin(np.radians(lean_deg)) * aside
    place = face().design_points.centroid_mm - 700.0 * way
    return RigCamera(
        f"cam{seed:02d}", compact_camera(), Pose.looking_at(place, place + way, roll), 700.0
    )


@pytest.mark.parametrize("seed", range(20))
def test_wedges_that_lean_to_any_side_are_printed(seed: int) -> None:
    camera = leaning(seed, 3.0 * (seed + 1))
    made = built((camera,))
    (wedge,) = made.structure.wedges
    part = print_part(wedge, CATALOGUE)
    mesh = wedge_mesh(part)
    assert mesh.is_watertight and mesh.body_count == 1
    assert overhang_deg(mesh) <= LIMIT_DEG
    check_keys(made)
    placed = (made.mounts[0].camera,)
    clashes = find_clashes(made.structure.solids, made.joined, placed, around())
    assert not [c for c in clashes if c.kind == "solid" and c.one != "head entry"]
    solid = next(s for s in made.structure.solids if s.owner == wedge.id)
    printed = carried(part.rig_from_print, part.corners_mm)
    order = [np.lexsort(points.round(6).T) for points in (solid.corners_mm, printed)]
    assert np.allclose(solid.corners_mm[order[0]], printed[order[1]], atol=1e-6)


def test_a_camera_that_looks_too_far_aside_is_told_how_far_to_turn_it() -> None:
    with pytest.raises(InputError, match=r"turn it (\d+) degrees towards") as raised:
        built((leaning(3, 88.0),))
    assert "\n" not in str(raised.value)


@pytest.mark.slow
def test_a_name_that_does_not_fit_is_what_is_told() -> None:
    camera = leaning(0, 10.0)
    named = RigCamera("M" * 120, camera.camera, camera.pose, 700.0)
    with pytest.raises(InputError, match="does not fit"):
        built((named,))


def test_the_steps_put_the_camera_onto_the_wedge_before_the_wedge_onto_the_post() -> None:
    made = built(face_cameras(face(), 4))
    steps = assembly_steps(made.structure, made.mounts, CATALOGUE)
    for mount in made.mounts:
        text = next(step for step in steps if f"Hang {mount.name}" in step)
        camera = text.index(f"{mount.name} onto {mount.name} wedge")
        wedge = text.index(f"{mount.name} wedge onto {mount.name} post")
        assert text.index(f"{mount.name} post to plate") < camera < wedge < text.index("cable")


def test_a_plan_of_a_plate_has_no_clash() -> None:
    subject, limits = face(), face_limits()
    cameras = face_cameras(subject, 5)
    made = make_plan(cameras, subject, limits, parse_system('kind = "plate"'), trials=0)
    assert made.clashes == ()
    system = built(cameras)
    placed = tuple(mount.camera for mount in system.mounts)
    assert find_clashes(system.structure.solids, system.joined, placed, around()) == ()
