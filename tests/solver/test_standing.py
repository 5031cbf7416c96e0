"""Cameras that stand already: which cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigs import compact_camera, ellipsoid_mesh, face, face_limits

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.raycast import Occluder
from solver.design import design
from solver.limits import Limits
from solver.standing import as_it_stands, check_places, inside

MIDDLE = np.array([0.0, -80.0, 0.0])


def at(*position_mm: float, name: str = "old", **changes: object) -> RigCamera:
    pose = Pose.looking_at(np.array(position_mm), MIDDLE)
    return RigCamera(name, compact_camera(**changes), pose, 700.0, fixed=True)


def test_a_camera_within_the_head_is_refused_wherever_it_comes_in() -> None:
    subject, limits = face(), face_limits()
    good = (at(-200.0, -700.0, 0.0, name="a"), at(200.0, -700.0, 0.0, name="b"))
    assert as_it_stands(subject, good, limits).cameras == good
    bad = at(10.0, 20.0, 30.0)
    with pytest.raises(
        InputError, match=r"'old' at \(10, 20, 30\) mm is inside the scan"
    ) as caught:
        as_it_stands(subject, (*good, bad), limits)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="inside the scan"):
        design(subject, compact_camera(), limits, count=3, fixed=(bad,))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9])
def test_inside_is_told_all_the_way_to_the_skin_of_an_open_head(share: float) -> None:
    vertices, faces = ellipsoid_mesh(30, 40)
    open_below = vertices[faces].mean(axis=1)[:, 2] > -70.0
    head = Occluder(vertices, faces[open_below])
    way = np.array([0.3, -0.9, 0.3])
    skin = way / np.linalg.norm(way / [75.0, 95.0, 105.0])
    assert inside(head, Pose.looking_at(share * skin, 3.0 * skin))
    assert not inside(head, Pose.looking_at((2.2 - share) * skin, np.zeros(3)))


def test_a_body_that_reaches_into_the_head_is_refused() -> None:
    # The centre is outside, 30 mm before the skin at y = -95; the body reaches back through it.
    wide = at(0.0, -125.0, 0.0, min_focus_distance_mm=51.0)
    turned = replace(wide, pose=Pose.looking_at(np.array([0.0, -125.0, 0.0]), [0.0, -900.0, 0.0]))
    with pytest.raises(InputError, match=r"body of camera 'old' at .* reaches into the subject"):
        check_places(face(), (turned,), face_limits())


def test_a_camera_nearer_than_its_lens_is_refused() -> None:
    with pytest.raises(InputError, match=r"stands 1.. mm from .* nearer than 342 mm unsharp"):
        check_places(face(), (at(0.0, -200.0, 0.0),), face_limits())
    check_places(face(), (at(0.0, -500.0, 0.0),), face_limits())


def test_angles_in_radians_are_told_where_they_look_past_the_subject() -> None:
    position = np.array([0.0, -700.0, 0.0])
    askew = Pose.from_omega_phi_kappa(position, np.array([1.571, 0.0, 0.0]))
    with pytest.raises(InputError, match=r"did you mean \[90.01, 0, 0\] \(radians\)"):
        check_places(face(), (replace(at(*position), pose=askew),), face_limits())
    with pytest.raises(InputError, match=r"start pose 2 looks past"):
        good = Pose.looking_at(position, MIDDLE)
        design(face(), compact_camera(), Limits(), count=2, start=(good, askew))
    # Straight down on what lies below is no mistake.
    above = Pose.from_omega_phi_kappa(np.array([0.0, -80.0, 700.0]), np.array([1.5, 0.0, 0.0]))
    check_places(face(), (replace(at(*position), pose=above),), face_limits())
