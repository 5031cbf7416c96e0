"""Every system: chains reach the designed poses exactly before anything is rounded."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from rigs import compact_camera, face, face_cameras, face_limits

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.clashes import Site, find_clashes, pairs
from rig.build.mounts.kinematics import turned_over
from rig.build.mounts.solids import camera_solids, round_part
from rig.build.mounts.structure import Structure
from rig.build.mounts.surroundings import Surroundings, head_entry
from rig.build.mounts.systemfile import parse_system
from rig.build.mounts.systems.base import Built, Holding

KINDS = ("t-slot", "plate", "arc", "tripods")


@cache
def around() -> Surroundings:
    return Surroundings(face(), face_limits(), (head_entry(face(), -1400.0),), -1400.0, 2.0)


@cache
def cameras() -> tuple[RigCamera, ...]:
    """Five cameras, rolled by odd angles as designs are; tripods stand apart enough for four."""
    rolls = (0.0, 25.0, -33.0, 160.0)
    found = face_cameras(face(), 4)
    target = face().design_points.centroid_mm
    return tuple(
        c.moved_to(Pose.looking_at(c.pose.position_rig_mm, target, roll))
        for c, roll in zip(found, rolls, strict=True)
    )


@cache
def held(kind: str) -> tuple[Holding, Built]:
    holding = parse_system(f'kind = "{kind}"').system.hold(cameras(), around())
    return holding, holding.build()


@pytest.mark.parametrize("kind", KINDS)
def test_the_chain_gives_the_designed_pose(kind: str) -> None:
    for camera, mount in zip(cameras(), held(kind)[0].mounts, strict=True):
        pose = mount.pose()
        assert np.abs(pose.position_rig_mm - camera.pose.position_rig_mm).max() < 1e-6
        turned = turned_over(camera.pose).rotation_rig_to_camera
        off = min(
            np.abs(pose.rotation_rig_to_camera - r).max()
            for r in (camera.pose.rotation_rig_to_camera, turned)
        )
        assert off < 1e-8


@pytest.mark.parametrize("kind", ["t-slot", "plate", "arc"])
def test_nothing_clashes(kind: str) -> None:
    holding, built = held(kind)
    placed = tuple(mount.camera for mount in holding.mounts)
    assert find_clashes(built.structure.solids, built.joined, placed, around()) == ()


@pytest.mark.parametrize("kind", KINDS)
def test_everything_named_is_part_of_the_structure(kind: str) -> None:
    _, built = held(kind)
    names = _names(built.structure)
    for mount in built.mounts:
        assert set(mount.carried_by) <= names
        assert len(mount.tapes) >= 2
    for joint in built.structure.joints:
        assert {joint.on, joint.other} <= names | {c.name for c in cameras()}


def _names(structure: Structure) -> set[str]:
    groups = (structure.members, structure.plates, structure.wedges, structure.parts)
    return {part.id for group in groups for part in group}


@pytest.mark.parametrize("kind", KINDS)
def test_names_are_unique(kind: str) -> None:
    structure = held(kind)[1].structure
    ids = [p.id for g in (structure.members, structure.parts, structure.wedges) for p in g]
    assert len(ids) == len(set(ids))
    joints = [joint.id for joint in structure.joints]
    assert len(joints) == len(set(joints))


@pytest.mark.parametrize("kind", ["t-slot", "arc"])
def test_frames_are_cut_to_whole_millimetres_where_cameras_hang(kind: str) -> None:
    for member in held(kind)[1].structure.members:
        if member.role in ("upright", "stub", "arm", "facet"):
            assert abs(member.length_mm - round(member.length_mm)) < 1e-6


def test_a_post_stands_on_its_two_holes() -> None:
    structure = held("plate")[1].structure
    plate = structure.plates[0]
    for member in structure.members:
        if member.role != "post":
            continue
        holes = [h for h in plate.holes if h.label.startswith(member.id.removesuffix(" post"))]
        assert len(holes) == 2
        middle = np.mean([[h.x_mm, h.y_mm, 0.0] for h in holes], axis=0)
        foot = plate.rig_from_plate[:3, :3] @ middle + plate.rig_from_plate[:3, 3]
        assert np.allclose(foot, member.axis_mm[0])
        apart = np.hypot(holes[0].x_mm - holes[1].x_mm, holes[0].y_mm - holes[1].y_mm)
        # The bores of 2040 are 20 mm apart.
        assert apart == pytest.approx(20.0)


def test_a_wedge_carries_the_thread_over_its_seat() -> None:
    _, built = held("plate")
    for wedge, mount in zip(built.structure.wedges, built.mounts, strict=True):
        seat = wedge.rig_from_base @ wedge.base_from_seat
        body = mount.camera.camera.body
        mouth = mount.camera.pose.to_rig(body.mount_thread_camera_mm[None])[0]
        assert np.allclose(seat[:3, 3], mouth)
        assert np.allclose(seat[:3, 2], -mount.camera.pose.rotation_rig_to_camera[1])


def test_a_head_that_cannot_reach_says_what_it_can() -> None:
    steep = RigCamera(
        "cam01", compact_camera(), Pose.looking_at(np.array([0.0, -400.0, -700.0]), np.zeros(3)),
        700.0,
    )  # fmt: skip
    with pytest.raises(InputError) as raised:
        parse_system('kind = "tripods"').system.hold((steep,), around())
    assert re.search(r"tilt 60\.3 .*nearest it can do is pan .*tilt 44\.0", str(raised.value))


def test_a_tripod_that_is_too_low_says_its_range() -> None:
    high = RigCamera(
        "cam01", compact_camera(), Pose.looking_at(np.array([0.0, -900.0, 700.0]), np.zeros(3)),
        700.0,
    )  # fmt: skip
    with pytest.raises(InputError, match="720 to 1800 mm"):
        parse_system('kind = "tripods"').system.hold((high,), around())


def test_a_rod_in_a_view_and_one_in_the_way_are_found() -> None:
    camera = cameras()[0]
    middle = 0.5 * (camera.pose.position_rig_mm + face().design_points.centroid_mm)
    at = np.eye(4)
    at[:3, 3] = middle
    rod = round_part("rod", "member", at, 10.0, -5.0, 5.0)
    solids = (*camera_solids(camera), rod)
    found = find_clashes(solids, pairs(), (camera,), around())
    assert [(c.kind, c.one, c.other) for c in found] == [("view", "cam01", "rod")]
    at[:3, 3] = camera_solids(camera)[0].corners_mm.mean(axis=0)
    through = round_part("rod", "member", at, 10.0, -200.0, 200.0)
    found = find_clashes((*camera_solids(camera), through), pairs(), (camera,), around())
    assert ("solid", "cam01", "rod") in [(c.kind, c.one, c.other) for c in found]
    site = Site(camera_solids(camera), (camera,), around(), 0.0)
    assert site.clashes((through,), pairs()) > 0
    assert site.clashes((through,), pairs(("cam01", "rod"))) < site.clashes((through,), pairs())


def test_the_head_entry_is_kept_free() -> None:
    at = np.eye(4)
    at[:3, 3] = [0.0, 300.0, -200.0]
    found = find_clashes((round_part("rod", "member", at, 10.0, 0.0, 50.0),), pairs(), (), around())
    assert [(c.kind, c.one) for c in found] == [("solid", "head entry")]
