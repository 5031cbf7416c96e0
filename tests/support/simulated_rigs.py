"""Small cameras about the simulated studio, and reports of a trigger box for them."""

from __future__ import annotations

import numpy as np

from geometry.camera import Body, Camera, RigCamera
from geometry.frames import Pose
from rig.acquisition.trigger.box import Edge, FireOutcome, FireReport

NONE = (0.0, 0.0, 0.0, 0.0, 0.0)
STRONG = (-0.28, 0.11, 0.002, -0.003, -0.02)


def lens(
    width_px: int = 400,
    view_deg: float = 26.0,
    distortion: tuple[float, ...] = NONE,
    f_number: float = 16.0,
    principal_point_px: tuple[float, float] | None = None,
) -> Camera:
    """A camera of 8 x 6 mm sensor, whatever its pixels."""
    height_px = width_px * 3 // 4
    pitch = 8.0 / width_px
    focal = 4.0 / np.tan(np.radians(view_deg / 2.0))
    middle = ((width_px - 1) / 2.0, (height_px - 1) / 2.0)
    return Camera(
        "simulated test lens",
        (width_px, height_px),
        pitch,
        float(focal),
        f_number,
        0.01,
        100.0,
        Body([60.0, 45.0, 30.0], [0.0, 0.0, -30.0]),
        principal_point_px=np.array(principal_point_px or middle),
        distortion=np.array(distortion),
    )


def placed(
    camera: Camera,
    position_mm: tuple[float, float, float] = (0.0, -930.0, 0.0),
    name: str = "cam01",
    target_mm: tuple[float, float, float] = (0.0, -40.0, 0.0),
    focus_mm: float | None = None,
) -> RigCamera:
    """The camera at a place, looking at the head, focused on the face unless told otherwise."""
    position = np.array(position_mm)
    pose = Pose.looking_at(position, np.array(target_mm))
    focus = float(np.linalg.norm(position - [0.0, -95.0, 0.0])) if focus_mm is None else focus_mm
    return RigCamera(name, camera, pose, focus)


def three(camera: Camera) -> tuple[RigCamera, ...]:
    """Left, middle and right of the face."""
    places = ((-330.0, -860.0, 30.0), (0.0, -930.0, 0.0), (330.0, -850.0, -40.0))
    return tuple(placed(camera, place, f"cam{k:02d}") for k, place in enumerate(places, 1))


def report(
    capture_id: str,
    at_ns: int,
    delays_us: dict[int, float],
    shots: int = 1,
    interval_us: float = 0.0,
    width_us: float = 1000.0,
) -> FireReport:
    """What a box says that fired the given outputs with the given delays."""
    edges = [
        Edge(shot, output, rising, at_us, round(at_ns + at_us * 1e3 + start_us * 1e3), 0.0)
        for shot in range(1, shots + 1)
        for start_us in [(shot - 1) * interval_us]
        for output, delay_us in delays_us.items()
        for rising, at_us in ((True, delay_us), (False, delay_us + width_us))
    ]
    edges.sort(key=lambda edge: edge.at_host_ns)
    return FireReport(capture_id, FireOutcome.FIRED, shots, shots, tuple(edges), 20.0)
