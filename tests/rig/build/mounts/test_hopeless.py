"""A plan that cannot work says so at once, and says what would."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from rigs import compact_camera, face, face_limits

from common.errors import InputError
from geometry.camera import Body, RigCamera
from geometry.frames import Pose
from rig.build.mounts.making import make_plan
from rig.build.mounts.surroundings import Zone
from rig.build.mounts.systemfile import parse_system
from rig.build.mounts.systems.heads import HeadKind, stances
from rig.catalogue import load_catalogue

SOON_S = 10.0
KINDS = ("t-slot", "plate", "arc", "tripods")


def cameras(body: Body | None = None) -> tuple[RigCamera, ...]:
    target = face().design_points.centroid_mm
    kind = compact_camera() if body is None else replace(compact_camera(), body=body)
    out = []
    for k, azimuth in enumerate((-35.0, -12.0, 12.0, 35.0)):
        way = np.array([np.sin(np.radians(azimuth)), -np.cos(np.radians(azimuth)), 0.1])
        out.append(RigCamera(f"cam{k}", kind, Pose.looking_at(target + 900.0 * way, target), 900.0))
    return tuple(out)


@pytest.mark.parametrize("kind", KINDS)
def test_a_zone_around_everything_is_told_at_once(kind: str) -> None:
    spec = parse_system(f'kind = "{kind}"')
    spec = replace(spec, zones=(Zone("room", np.full(3, -5000.0), np.full(3, 5000.0)),))
    began = time.monotonic()
    with pytest.raises(InputError, match=r"reaches into room by \d+ mm.*keep the zone room clear"):
        make_plan(cameras(), face(), face_limits(), spec)
    assert time.monotonic() - began < SOON_S


@pytest.mark.parametrize("kind", KINDS)
def test_bodies_that_reach_into_each_other_are_told_at_once(kind: str) -> None:
    huge = Body([600.0, 500.0, 400.0], [0.0, 0.0, -230.0], 30.0, 25.0)
    began = time.monotonic()
    with pytest.raises(InputError, match=r"cam\d reaches into cam\d by \d+ mm.*true sizes"):
        make_plan(cameras(huge), face(), face_limits(), parse_system(f'kind = "{kind}"'))
    assert time.monotonic() - began < SOON_S


def test_a_head_without_the_range_names_one_that_has_it() -> None:
    catalogue = load_catalogue()
    named = HeadKind.named(next(iter(catalogue.heads)), catalogue)
    stiff = replace(named, ranges_deg=((-1.0, 1.0),) * 3)
    camera = cameras()[0]
    rolled = camera.moved_to(
        Pose.looking_at(camera.pose.position_rig_mm, face().design_points.centroid_mm, 8.0)
    )
    bases = [("level", np.eye(3))]
    able = [h.part.id for h in stiff.others if _holds(replace(h, others=()), rolled, bases)]
    assert able, "a head of the catalogue pans by 35 degrees and rolls by 8"
    with pytest.raises(InputError) as refused:
        stances(stiff, rolled, bases)
    assert f"choose head {able[0]}" in str(refused.value)
    with pytest.raises(InputError, match="no head of the catalogue can hold it"):
        stances(replace(stiff, others=()), rolled, bases)


def _holds(head: HeadKind, camera: RigCamera, bases: list[tuple[str, np.ndarray]]) -> bool:
    try:
        return bool(stances(head, camera, bases))
    except InputError:
        return False
