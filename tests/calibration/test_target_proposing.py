"""Proposed targets are seen by every camera, large enough, and can be printed and kept."""

from __future__ import annotations

import numpy as np
import pytest
import rigs

from calibration.targets.files import targets_from, targets_text
from calibration.targets.kinds import CharucoPlate, RingCarrier
from calibration.targets.proposing import DOT_RADIUS_PX, LARGEST_DOT_PX, propose_targets
from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose

FACE = np.array([160.0, 140.0, 220.0])


def cameras(
    count: int = 5, distance_mm: float = 900.0, focal_mm: float = 16.0
) -> tuple[RigCamera, ...]:
    kind = rigs.compact_camera(focal_length_mm=focal_mm)
    out = []
    for k, a in enumerate(np.radians(np.linspace(-40.0, 40.0, count))):
        place = distance_mm * np.array([np.sin(a), -np.cos(a), 0.15 * (-1) ** k])
        out.append(RigCamera(f"cam{k}", kind, Pose.looking_at(place, np.zeros(3)), distance_mm))
    return tuple(out)


def test_every_camera_sees_enough_at_the_right_size() -> None:
    rig = cameras()
    proposal = propose_targets(rig, np.zeros(3), FACE, per_camera=10)
    assert proposal.notes == ()
    stand = proposal.plan.carriers[1]
    assert isinstance(stand, RingCarrier)
    assert stand.fixed
    for camera, seen in zip(rig, proposal.cameras, strict=True):
        assert seen.targets >= 10
        assert seen.cells >= 5
        assert seen.radius_px[0] >= 0.8 * DOT_RADIUS_PX
        assert seen.radius_px[1] <= LARGEST_DOT_PX
        # Counted again from the places alone.
        pixels, _ = camera.camera.project(camera.pose, stand.carrier().nominal_mm)
        inside = ((pixels > 0) & (pixels < np.array(camera.camera.image_size_px))).all(axis=1)
        assert inside.sum() >= seen.targets


def test_targets_stand_clear_of_each_other_and_of_the_face() -> None:
    stand = propose_targets(cameras(), np.zeros(3), FACE).plan.carriers[1]
    assert isinstance(stand, RingCarrier)
    places = np.array([p.position_mm for p in stand.places])
    away = np.linalg.norm(places[:, None] - places[None], axis=2) + 1e9 * np.eye(len(places))
    assert away.min() >= 8.0 * stand.dot_radius_mm
    assert (np.linalg.norm(places / (FACE / 2.0), axis=1) > 1.0).all()


def test_a_proposal_can_be_written_as_a_file() -> None:
    plan = propose_targets(cameras(), np.zeros(3), FACE).plan
    again = targets_from(targets_text(plan))
    assert again.target_set().ids == plan.target_set().ids
    assert [c.name for c in plan.carriers] == ["plate", "stand", "bar1", "bar2", "bar3"]
    plate = plan.carriers[0]
    assert isinstance(plate, CharucoPlate)
    assert max(plate.size_mm) <= 0.8 * FACE.max()


def test_what_cannot_be_had_is_said() -> None:
    # A field of view about as wide as the face leaves no room for targets beside it.
    narrow = propose_targets(cameras(3, 900.0, 130.0), np.zeros(3), FACE)
    assert any("fewer than 12" in note for note in narrow.notes)
    coarse = propose_targets(cameras(3, 900.0, 16.0), np.zeros(3), FACE / 6.0)
    assert any("ChArUco plate would need" in note for note in coarse.notes)


def test_nonsense_is_refused() -> None:
    with pytest.raises(InputError, match="there are no cameras"):
        propose_targets((), np.zeros(3), FACE)
    with pytest.raises(InputError, match="has no size"):
        propose_targets(cameras(), np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match="behind camera cam0"):
        propose_targets(cameras(), np.array([0.0, -3000.0, 0.0]), FACE)
