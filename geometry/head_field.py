"""The synthetic head as an implicit solid: one function per part of the head.

Template frame: millimetres of a head 150 wide, 190 deep and 210 high; x to the subject's left,
y to the back, z up; the origin at mid height, between the ears. Paired parts are built once,
from ``|x|``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from geometry.implicit import difference, ellipsoid, intersection, round_cone, sphere, union

TEMPLATE_SIZE_MM = (150.0, 190.0, 210.0)
NECK_CUT_Z_MM = -150.0


@dataclass(frozen=True)
class Measures:
    """The head's measures in template millimetres, see ``geometry.head.HeadShape``."""

    face_half_width_mm: float
    jaw_half_width_mm: float
    chin_mm: float
    brow_mm: float
    eye_half_spacing_mm: float
    eye_depth_mm: float
    nose_length_mm: float
    nose_protrusion_mm: float
    nose_half_width_mm: float
    mouth_half_width_mm: float
    lip_mm: float
    ear_length_mm: float
    ear_protrusion_mm: float
    neck_radius_mm: float
    hair_mm: float
    shoulder_half_width_mm: float


def head_distance(points: Floats, m: Measures) -> Floats:
    """Signed distance (N,) of template points (N, 3) to the head with measures ``m``."""
    p = points.copy()
    p[:, 0] = np.abs(p[:, 0])
    d = union(_cranium(p), _face(p, m), 28.0)
    d = union(d, _neck(p, m), 26.0)
    d = union(d, _brow(p, m), 12.0)
    d = _eyes(p, d, m)
    d = _nose(p, d, m)
    d = _mouth(p, d, m)
    if m.hair_mm > 0.0:
        d = union(d, _hair(p, m), 5.0)
    d = _ear(p, d, m)
    if m.shoulder_half_width_mm > 0.0:
        d = union(d, _shoulders(p, m), 40.0)
    cut = NECK_CUT_Z_MM - (70.0 if m.shoulder_half_width_mm > 0.0 else 0.0)
    return intersection(d, cut - p[:, 2], 4.0)


def _cranium(p: Floats) -> Floats:
    vault = ellipsoid(p, (0.0, 12.0, 30.0), (74.0, 84.0, 74.5))
    forehead = ellipsoid(p, (0.0, -26.0, 34.0), (62.0, 62.0, 54.0))
    return union(vault, forehead, 24.0)


def _face(p: Floats, m: Measures) -> Floats:
    """Middle face, cheekbones, jaw and chin."""
    middle = ellipsoid(p, (0.0, -38.0, -28.0), (m.face_half_width_mm - 12.0, 51.0, 70.0))
    bone = ellipsoid(p, (m.face_half_width_mm - 20.0, -52.0, -18.0), (17.0, 25.0, 17.0))
    d = union(middle, bone, 22.0)
    angle = (m.jaw_half_width_mm - 13.0, -6.0, -62.0)
    jaw = round_cone(p, angle, (15.0, -68.0 - m.chin_mm, -90.0), 15.0, 14.0)
    d = union(d, jaw, 20.0)
    ramus = round_cone(p, angle, (m.face_half_width_mm - 10.0, 2.0, -15.0), 14.0, 14.0)
    d = union(d, ramus, 18.0)
    chin = ellipsoid(p, (0.0, -71.0 - m.chin_mm, -90.5), (21.0, 19.0, 15.0))
    return union(d, chin, 14.0)


def _neck(p: Floats, m: Measures) -> Floats:
    column = round_cone(
        p, (0.0, 14.0, -45.0), (0.0, 30.0, -240.0), m.neck_radius_mm, m.neck_radius_mm + 4.0
    )
    muscle = round_cone(p, (46.0, 14.0, -50.0), (14.0, -26.0, -170.0), 12.0, 11.0)
    return union(column, muscle, 16.0)


def _brow(p: Floats, m: Measures) -> Floats:
    inner = round_cone(p, (9.0, -80.0 - m.brow_mm, 21.0), (30.0, -76.0 - m.brow_mm, 25.0), 8.0, 7.5)
    outer = round_cone(p, (30.0, -76.0 - m.brow_mm, 25.0), (53.0, -57.0, 15.0), 7.5, 6.0)
    return union(inner, outer, 6.0)


def _eyes(p: Floats, d: Floats, m: Measures) -> Floats:
    """Sockets, eyeballs and lids."""
    x = m.eye_half_spacing_mm
    socket = ellipsoid(p, (x + 0.5, -93.0, 3.0), (20.0, 9.0 + m.eye_depth_mm, 12.5))
    d = difference(d, socket, 10.0)
    inner = ellipsoid(p, (15.0, -95.0, 3.0), (7.0, 11.0 + m.eye_depth_mm, 9.0))
    d = difference(d, inner, 8.0)
    y = -80.0 + m.eye_depth_mm
    ball = sphere(p, (x, y, 1.0), 12.0)
    lids = ellipsoid(p, (x, y - 0.2, 1.0), (14.5, 14.0, 13.8))
    # The lids part along an almond: what two discs of the x-z plane share.
    u, v = p[:, 0] - x, p[:, 2] - 0.6 - 0.05 * (p[:, 0] - x)
    upper = np.hypot(u, v + 15.0) - 20.3
    lower = np.hypot(u, v - 18.0) - 22.0
    almond = np.maximum(upper, lower)
    lids = difference(lids, np.maximum(almond, p[:, 1] - y), 1.2)
    d = union(d, lids, 4.0)
    return union(d, ball, 0.8)


def _nose(p: Floats, d: Floats, m: Measures) -> Floats:
    base_z = 6.0 - m.nose_length_mm
    tip_y = -92.0 - m.nose_protrusion_mm + 9.0
    w = m.nose_half_width_mm
    root = (0.0, -81.0 - 0.5 * m.brow_mm, 13.0)
    bridge = round_cone(p, root, (0.0, tip_y + 1.0, base_z + 9.0), 6.5, 7.5)
    tip = ellipsoid(p, (0.0, tip_y, base_z + 8.0), (9.5, 9.0, 8.5))
    nose = union(bridge, tip, 6.0)
    side = ellipsoid(p, (0.0, -86.0, base_z + 17.0), (w - 2.0, 17.0, 22.0))
    nose = union(nose, side, 8.0)
    wing = ellipsoid(p, (w - 6.5, -95.0, base_z + 6.0), (6.5, 10.5, 7.0))
    nose = union(nose, wing, 4.0)
    septum = round_cone(p, (0.0, tip_y + 4.0, base_z + 3.0), (0.0, -93.0, base_z - 1.0), 4.0, 4.5)
    nose = union(nose, septum, 3.0)
    d = union(d, nose, 7.0)
    nostril = ellipsoid(p, (w - 9.3, -98.5, base_z - 0.5), (3.6, 6.0, 4.6))
    return difference(d, nostril, 2.0)


def _mouth(p: Floats, d: Floats, m: Measures) -> Floats:
    w, full = m.mouth_half_width_mm, m.lip_mm
    z = -64.0
    muzzle = ellipsoid(p, (0.0, -76.0, z + 2.0), (w + 5.0, 20.0, 20.0))
    d = union(d, muzzle, 14.0)
    bow = round_cone(p, (5.0, -93.5, z + 4.5), (w - 1.0, -82.5, z - 0.5), full, 1.8)
    low = round_cone(p, (0.0, -92.5, z - 5.8), (w - 4.0, -83.0, z - 2.5), full + 1.0, 2.0)
    middle = sphere(p, (0.0, -94.0, z + 3.2), full - 0.6)
    upper = union(bow, middle, 3.0)
    d = union(d, union(upper, low, 0.8), 3.0)
    slit = round_cone(p, (0.0, -99.5, z - 0.7), (w - 2.0, -86.5, z - 0.9), 1.7, 1.5)
    d = difference(d, slit, 2.6)
    corner = sphere(p, (w + 1.0, -87.0, z - 1.0), 2.5)
    d = difference(d, corner, 4.0)
    philtrum = round_cone(p, (0.0, -103.0, z + 17.0), (0.0, -102.0, z + 8.0), 3.2, 3.4)
    d = difference(d, philtrum, 3.0)
    fold = ellipsoid(p, (0.0, -99.0, z - 15.5), (17.0, 8.5, 4.5))
    return difference(d, fold, 7.0)


def _ear(p: Floats, d: Floats, m: Measures) -> Floats:
    """A shell that stands off the head: rim, hollow, tragus and lobe."""
    q = _ear_frame(p, m)
    s = m.ear_length_mm / 63.0
    plate = ellipsoid(q, (0.0, 0.0, 0.0), (17.5 * s, 31.0 * s, 6.5))
    hollow = ellipsoid(q, (-1.5 * s, -1.0 * s, 7.5), (12.0 * s, 23.5 * s, 5.0))
    ear = difference(plate, hollow, 2.0)
    ridge = round_cone(q, (5.0 * s, 16.0 * s, 1.0), (4.0 * s, -12.0 * s, 1.0), 2.6, 3.0)
    ear = union(ear, ridge, 3.0)
    lobe = ellipsoid(q, (-5.0 * s, -26.0 * s, 0.5), (8.0 * s, 8.0 * s, 4.2))
    ear = union(ear, lobe, 5.0)
    tragus = ellipsoid(q, (-13.5 * s, -5.0 * s, 2.0), (4.5, 6.5 * s, 4.0))
    ear = union(ear, tragus, 3.0)
    concha = ellipsoid(q, (-4.0 * s, -5.0 * s, 5.5), (7.5 * s, 9.0 * s, 6.0))
    return difference(union(d, ear, 6.0), concha, 2.5)


def _ear_frame(p: Floats, m: Measures) -> Floats:
    """Points in the ear's own frame: towards its back rim, up, away from the head."""
    flare = np.arcsin(np.clip(m.ear_protrusion_mm / 36.0, 0.0, 0.95))
    lean = np.radians(14.0)
    back = np.array([np.sin(flare), np.cos(flare), 0.0])
    out = np.array([np.cos(flare), -np.sin(flare), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    back, up = np.cos(lean) * back - np.sin(lean) * up, np.sin(lean) * back + np.cos(lean) * up
    centre = np.array([71.5 + 0.5 * m.ear_protrusion_mm - 2.0, 10.0, -12.0])
    return np.asarray((p - centre) @ np.stack([back, up, out], axis=1))


def _hair(p: Floats, m: Measures) -> Floats:
    """A cap of hair over the vault, its line high on the forehead and before the ears."""
    cap = _cranium(p) - m.hair_mm
    line = 52.0 - 0.75 * (p[:, 1] + 40.0)
    low = np.where(p[:, 1] > 25.0, -60.0, -25.0)
    return intersection(cap, np.maximum(line, low) - p[:, 2], 8.0)


def _shoulders(p: Floats, m: Measures) -> Floats:
    w = m.shoulder_half_width_mm
    beam = round_cone(p, (0.0, 30.0, -205.0), (w - 48.0, 32.0, -222.0), 62.0, 48.0)
    slope = round_cone(p, (25.0, 34.0, -110.0), (w - 45.0, 34.0, -195.0), 22.0, 26.0)
    return union(beam, slope, 30.0)
