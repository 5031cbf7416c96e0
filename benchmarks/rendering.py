"""How fast simulated pictures are rendered, and in how much memory, beside a naive cast.

    python -m benchmarks.rendering [--scan head.glb --texture colour.jpg --displacement height.jpg
                                    --flip-texture] [--out docs/explanation/rendering.md]
    python -m benchmarks.rendering --picture docs/pictures/simulated.jpg

Seven cameras of 2000 x 1500 pixels about a head, 8 bits RGB, with depth of field and noise, each
program in a process of its own with one thread. The naive cast takes one ray per pixel for the
whole picture at once and shades in double precision: no edges smoothed, no defocus, no noise.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import cv2
import numpy as np

from geometry.camera import Body, Camera, RigCamera
from geometry.frames import Pose
from geometry.raycast import Occluder
from rig.simulation.flatsettings import BoardSettings, PlaceSettings, TargetSettings
from rig.simulation.sampling import LINEAR_OF_SRGB
from rig.simulation.settings import HeadSettings, SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

CAMERAS = 7
LIMIT_S = 2.0
LIMIT_GIB = 1.0


_HEADING = """\
# Speed of the simulated cameras

Command: `python -m benchmarks.rendering --out docs/explanation/rendering.md` (with `--scan`,
`--texture` and `--displacement` for a scan).
Seven cameras of 2000 x 1500 pixels, RGB, 8 bits, 26 degrees across,
0.9 m away; seconds of one core. "Ours" is the whole picture: light and soft shadow, grain, smoothed
edges, depth of field, lens, noise, coding. "Naive" casts one ray per pixel, the whole picture at
once, with one light and no more.

Limits: {limit_s:g} s per picture and core, {limit_gib:g} GiB per process.

| head | ours, mean s | worst s | peak GiB | first picture s | naive, mean s | peak GiB |
|---|---|---|---|---|---|---|
"""

_ENDING = """
The first picture includes reading the head, its shadows and the table of rays; each process does
this once.
"""


@dataclass(frozen=True)
class Cost:
    """Seconds of one core per picture, the longest picture, seconds to get ready, peak memory."""

    mean_s: float
    worst_s: float
    ready_s: float
    peak_gib: float


def lens(width_px: int = 2000) -> Camera:
    """26 degrees across, distorted."""
    pitch = 8.0 / width_px
    return Camera(
        "benchmark",
        (width_px, width_px * 3 // 4),
        pitch,
        4.0 / float(np.tan(np.radians(13.0))),
        16.0,
        2.0 * pitch,
        100.0,
        Body([60.0, 45.0, 30.0], [0.0, 0.0, -30.0]),
        distortion=np.array([-0.12, 0.05, 0.0, 0.0, 0.0]),
    )


def ring(camera: Camera) -> tuple[RigCamera, ...]:
    """Cameras on a ring of 300 mm, 0.9 m before the face."""
    out = []
    for k in range(CAMERAS):
        turn = 2.0 * np.pi * k / CAMERAS
        place = np.array([300.0 * np.cos(turn), -850.0, 300.0 * np.sin(turn)])
        focus = float(np.linalg.norm(place - [0.0, -95.0, 0.0]))
        pose = Pose.looking_at(place, np.array([0.0, -40.0, 0.0]))
        out.append(RigCamera(f"cam{k + 1:02d}", camera, pose, focus))
    return tuple(out)


def ours(head: HeadSettings) -> Cost:
    """The studio, tables of rays made before the clock starts, as in a service that runs."""
    cv2.setNumThreads(1)
    began = time.process_time()
    rig = ring(lens())
    studio = Studio(rig, SceneSettings(head=head))
    studio.photograph(Shot(rig[0].name, 4000.0))
    ready = time.process_time() - began
    seconds = []
    for camera in rig:
        began = time.process_time()
        studio.photograph(Shot(camera.name, 4000.0, seed=(1,)))
        seconds.append(time.process_time() - began)
    return Cost(float(np.mean(seconds)), max(seconds), ready, _peak_gib())


def naive(head: HeadSettings) -> Cost:
    """One ray per pixel, all at once."""
    cv2.setNumThreads(1)
    began = time.process_time()
    rig = ring(lens())
    mesh = Studio(rig, SceneSettings(head=head)).surface
    if mesh is None:
        raise SystemExit("the scene has no head")
    occluder = Occluder(mesh.vertices_mm, mesh.faces)
    width, height = rig[0].camera.image_size_px
    y, x = np.mgrid[:height, :width]
    rays = rig[0].camera.rays(np.stack([x.ravel(), y.ravel()], axis=1).astype(float))
    ready, seconds = time.process_time() - began, []
    colours = LINEAR_OF_SRGB[mesh.picture].astype(float)
    for camera in rig:
        began = time.process_time()
        directions = rays @ camera.pose.rotation_rig_to_camera
        eyes = np.tile(camera.pose.position_rig_mm, (len(rays), 1))
        triangle, distance = occluder.first_hits(eyes, directions)
        hit = np.flatnonzero(triangle >= 0)
        places = eyes[hit] + distance[hit, None] * directions[hit]
        corners = mesh.vertices_mm[mesh.faces[triangle[hit]]]
        weights = barycentric(places, corners)
        normal = (mesh.normals[mesh.faces[triangle[hit]]] * weights[..., None]).sum(axis=1)
        light = 0.2 + 0.8 * np.maximum(normal @ np.array([-0.57, -0.68, 0.46]), 0.0)
        column, row = (mesh.texture_px[triangle[hit]] * weights[..., None]).sum(axis=1).T
        seen = bilinear(colours, column, row) * light[:, None]
        picture = np.full((height * width, 3), 40, dtype=np.uint8)
        picture[hit] = np.clip(255.0 * seen ** (1.0 / 2.2), 0, 255)
        seconds.append(time.process_time() - began)
    return Cost(float(np.mean(seconds)), max(seconds), ready, _peak_gib())


def barycentric(places: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Weights (N, 3) of places in triangles (N, 3, 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = places - corners[:, 0]
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    pa, pb = (p * a).sum(1), (p * b).sum(1)
    scale = aa * bb - ab * ab
    v, w = (bb * pa - ab * pb) / scale, (aa * pb - ab * pa) / scale
    return np.stack([1.0 - v - w, v, w], axis=1)


def bilinear(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Colours (N, 3) between pixels, in plain NumPy."""
    height, width = picture.shape[:2]
    x, y = np.clip(x, 0, width - 1.001), np.clip(y, 0, height - 1.001)
    left, top = x.astype(int), y.astype(int)
    fx, fy = (x - left)[:, None], (y - top)[:, None]
    upper = picture[top, left] * (1 - fx) + picture[top, left + 1] * fx
    lower = picture[top + 1, left] * (1 - fx) + picture[top + 1, left + 1] * fx
    return np.asarray(upper * (1 - fy) + lower * fy)


def _peak_gib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2.0**20


def measured(head: HeadSettings) -> tuple[Cost, Cost]:
    """Both in processes of their own, so that neither's memory counts for the other."""
    costs = []
    for program in (ours, naive):
        with get_context("spawn").Pool(1) as pool:
            costs.append(pool.apply(program, (head,)))
    return costs[0], costs[1]


def table(rows: list[tuple[str, Cost, Cost]]) -> str:
    """The document."""
    lines = _HEADING.format(limit_s=LIMIT_S, limit_gib=LIMIT_GIB).splitlines()
    lines += [
        f"| {name} | {a.mean_s:.2f} | {a.worst_s:.2f} | {a.peak_gib:.2f} | {a.ready_s:.1f} "
        f"| {b.mean_s:.2f} | {b.peak_gib:.2f} |"
        for name, a, b in rows
    ]
    return "\n".join([*lines, *_ENDING.splitlines()]) + "\n"


def picture(path: Path) -> None:
    """Two cameras' views of the synthetic head with targets, for the documentation."""
    board = BoardSettings(PlaceSettings((0.0, -150.0, -150.0), (0.0, -1.0, 0.35)))
    facing = (0.0, -1.0, 0.0)
    targets = (
        TargetSettings("charuco", PlaceSettings((150.0, 60.0, 40.0), facing), 18.0, squares=(5, 7)),
        TargetSettings("aruco", PlaceSettings((-150.0, 60.0, 60.0), facing), 60.0, marker_id=3),
    )
    views = []
    for place in ((0.0, -1150.0, 30.0), (620.0, -930.0, 120.0)):
        position = np.array(place)
        pose = Pose.looking_at(position, np.array([0.0, -40.0, -25.0]))
        focus = float(np.linalg.norm(position - [0.0, -95.0, 0.0]))
        rig = (RigCamera("cam01", lens(1600), pose, focus),)
        scene = SceneSettings(targets=targets, board=board)
        shot = Shot("cam01", 4000.0, board_start_us=1_234_500.0)
        large = Studio(rig, scene, SensorSettings()).photograph(shot)
        views.append(
            cv2.resize(large[:, 200:1400], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        )
    sheet = np.ascontiguousarray(np.hstack(views)[..., ::-1])
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), sheet, [cv2.IMWRITE_JPEG_QUALITY, 88])


def main() -> None:
    """See the module."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    for name in ("scan", "texture", "displacement", "out", "picture"):
        arguments.add_argument(f"--{name}", type=Path)
    arguments.add_argument("--flip-texture", action="store_true")
    given = arguments.parse_args()
    if given.picture:
        picture(given.picture)
        return
    heads = [("synthetic, 272,000 faces", HeadSettings())]
    if given.scan:
        scan = HeadSettings(
            given.scan, given.texture, given.displacement, given.flip_texture, subdivisions=2
        )
        heads.append(("scan, subdivided twice", scan))
    rows = []
    for name, head in heads:
        rows.append((name, *measured(head)))
        print(rows[-1], flush=True)
    text = table(rows)
    print(text)
    if given.out:
        given.out.write_text(text)


if __name__ == "__main__":
    main()
