"""Every wedge that is called printable stands by itself on the bed."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from rigs import compact_camera, face
from scipy.spatial import ConvexHull

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.structure import Wedge
from rig.build.mounts.systemfile import parse_system
from rig.build.mounts.systems.fits import Fitter
from rig.build.mounts.systems.plate import PLATE_AXES, PlateSystem
from rig.build.wedges import print_part, wedge_mesh
from rig.build.wedges.shape import LEAST_BED_MM2, STANDS_SHARE, shapes_of, stands
from rig.build.wedges.solid import stands_on_bed
from rig.solids.convex import box_corners


def plate() -> PlateSystem:
    system = parse_system('kind = "plate"').system
    assert isinstance(system, PlateSystem)
    return system


def wedge_for(azimuth: float, elevation: float, roll: float) -> Wedge:
    """The wedge of a camera that looks at the face from there."""
    target = face().design_points.centroid_mm
    az, el = np.radians([azimuth, elevation])
    way = np.array([np.sin(az) * np.cos(el), -np.cos(az) * np.cos(el), np.sin(el)])
    pose = Pose.looking_at(target + 900.0 * way, target, roll)
    camera = RigCamera("cam01", compact_camera(), pose, 900.0)
    system = plate()
    return next(Fitter(PLATE_AXES, system.profile, system.catalogue).fits(camera)).wedge


VIEWS = [(14, -21, -165), (11, 21, 16), (36, -42, 83), (-38, 15, 53), (-1, 35, 156), (22, 2, -68)]


@pytest.mark.parametrize(("azimuth", "elevation", "roll"), VIEWS)
def test_a_wedge_does_not_fall_over(azimuth: float, elevation: float, roll: float) -> None:
    mesh = wedge_mesh(print_part(wedge_for(azimuth, elevation, roll), plate().catalogue))
    assert mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    # Down-facing triangles at the height of the bed, found by their normals and not by the code.
    bottom = (mesh.face_normals[:, 2] < -0.999) & (mesh.triangles_center[:, 2] < 0.01)
    assert mesh.area_faces[bottom].sum() >= LEAST_BED_MM2
    corners = mesh.triangles[bottom].reshape(-1, 3)[:, :2]
    face_on_bed = ConvexHull(corners)
    # Weight pulls along a line that leans by 5.7 degrees to any side: it stays inside the face.
    for turn in np.linspace(0.0, 2.0 * np.pi, 24):
        lean = STANDS_SHARE * np.array([np.cos(turn), np.sin(turn)])
        foot = mesh.center_mass[:2] + mesh.center_mass[2] * lean
        beyond = face_on_bed.equations[:, :2] @ foot + face_on_bed.equations[:, 2]
        assert beyond.max() <= 1e-6
    assert np.ptp(mesh.vertices[:, 2]) < 60.0, "the base is 40 mm wide: it lies, it does not tower"


@pytest.mark.parametrize(
    ("size", "off", "ok"),
    [
        ((20.0, 20.0, 40.0), 0.0, True),
        ((12.0, 12.0, 40.0), 0.0, False),  # 144 mm2 are too few
        ((40.0, 6.0, 100.0), 0.0, False),  # 3 mm to the edge under a centre 50 mm up
        ((40.0, 6.0, 28.0), 0.0, True),  # 3 mm under 14 mm
        ((20.0, 20.0, 40.0), 8.5, False),  # the mass hangs over the edge
        ((20.0, 20.0, 40.0), 7.5, True),
    ],
)
def test_standing_is_a_face_with_the_mass_inside(
    size: tuple[float, float, float], off: float, ok: bool
) -> None:
    corners = box_corners(np.array(size), np.array([0.0, 0.0, size[2] / 2.0]))
    assert stands(corners, np.array([off, 0.0, size[2] / 2.0])) == ok
    if off == 0.0:
        mesh = trimesh.convex.convex_hull(corners)
        assert stands_on_bed(mesh) == ok
        mesh.apply_translation([0.0, 0.0, 6.0])
        assert not stands_on_bed(mesh), "a part that hovers stands on nothing"


def test_an_edge_or_a_corner_is_no_face() -> None:
    roof = np.array([[0.0, 0, 0], [40.0, 0, 0], [0.0, 20, 30], [40.0, -20, 30.0]])
    assert not stands(roof, np.array([20.0, 0.0, 15.0]))
    assert not stands(np.array([[0.0, 0, 0], [9.0, 9, 9]]), np.array([0.0, 0.0, 3.0]))


def test_a_wedge_that_cannot_stand_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wedge = wedge_for(11, 21, 16)
    for shape in shapes_of(wedge):
        assert shape.corners_mm[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    monkeypatch.setattr("rig.build.wedges.shape.LEAST_BED_MM2", 1e6)
    with pytest.raises(InputError, match="has no face to stand on by itself; make the base larger"):
        print_part(wedge, plate().catalogue)
