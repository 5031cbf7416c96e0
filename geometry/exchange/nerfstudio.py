"""nerfstudio's ``transforms.json``.

Camera to world, metres, camera axes x right, y up, looking along -z; world Z up, which is the
rig's own. The corner of the image is (0, 0): nerfstudio shoots its rays through pixel centres
at 0.5. Each frame carries its own intrinsics.

Which images train and which evaluate is said in the file: left to itself, nerfstudio keeps a tenth
for evaluation, rounded down, which is none of a face rig's seven.
"""

from __future__ import annotations

import json

from common.errors import InputError
from geometry.camera import TERM_NAMES, LensModel, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name
from geometry.exchange.conventions import (
    METRES_PER_MM,
    corner_principal_point_px,
    graphics_camera_to_rig,
)

IMAGES = "images"


def _frame(rig_camera: RigCamera, options: ExportOptions) -> dict[str, object]:
    camera = rig_camera.camera
    terms = zip(TERM_NAMES[camera.lens_model], camera.distortion.tolist(), strict=True)
    cx, cy = corner_principal_point_px(camera)
    return {
        "file_path": f"{IMAGES}/{image_name(rig_camera, options)}",
        "fl_x": camera.focal_length_px,
        "fl_y": camera.focal_length_px,
        "cx": float(cx),
        "cy": float(cy),
        "w": camera.image_size_px[0],
        "h": camera.image_size_px[1],
        **dict(sorted(terms)),
        "transform_matrix": graphics_camera_to_rig(rig_camera.pose, METRES_PER_MM).tolist(),
    }


EVALUATED_SHARE = 0.1
"""Share of the images that are kept from training, as in nerfstudio, but at least one."""

FEWEST_TRAINED = 2


def _split(paths: list[object]) -> dict[str, list[object]]:
    """File names by what they are for; nothing where too few would be left to train on."""
    count = max(1, int(EVALUATED_SHARE * len(paths)))
    if len(paths) - count < FEWEST_TRAINED:
        return {}
    # Spread over the rig: of one the middle camera, whose view its neighbours know best.
    kept = {int((k + 0.5) * len(paths) / count) for k in range(count)}
    held = [path for k, path in enumerate(paths) if k in kept]
    trained = [path for k, path in enumerate(paths) if k not in kept]
    return {"train_filenames": trained, "val_filenames": held, "test_filenames": held}


def _model(cameras: Cameras) -> str:
    """Nerfstudio's name of the lens model, one for all frames."""
    lenses = {camera.camera.lens_model for camera in cameras}
    if len(lenses) > 1:
        raise InputError(
            "export-lens-model",
            "nerfstudio takes one lens model, and these cameras have several",
            "export to opencv or colmap-text, which take each camera's own",
        )
    return "OPENCV_FISHEYE" if LensModel.FISHEYE in lenses else "OPENCV"


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """``transforms.json``."""
    frames = [_frame(camera, options) for camera in cameras]
    split = _split([frame["file_path"] for frame in frames])
    document = {"camera_model": _model(cameras), **split, "frames": frames}
    return {"transforms.json": (json.dumps(document, indent=1) + "\n").encode()}


FORMAT = Format(
    "nerfstudio",
    "nerfstudio",
    "transforms.json with the intrinsics of each frame",
    ("transforms.json",),
    write,
    (LensModel.BROWN, LensModel.FISHEYE),
)
