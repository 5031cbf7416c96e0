"""Pictures with the targets that were detected in them: one of each camera."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.detection.images import picture_from, read_picture
from calibration.detection.pictures import DetectedPictures
from common.page.html import esc
from geometry.arrays import Floats

WIDTH_PX = 480
MARK_PX = 3.0
QUALITY = 70


@dataclass(frozen=True, eq=False)
class DetectionView:
    """A camera's small picture, JPEG of ``size_px``, and the targets' places in it, (n, 2)."""

    camera: str
    frame: str
    jpeg: bytes
    size_px: tuple[int, int]
    marks_px: Floats


def detection_views(seen: DetectedPictures) -> tuple[DetectionView, ...]:
    """Of each camera the picture in which most targets were found."""
    best: dict[str, int] = {}
    for k, (picture, found) in enumerate(zip(seen.pictures, seen.detections, strict=True)):
        if picture.camera not in best or len(found) > len(seen.detections[best[picture.camera]]):
            best[picture.camera] = k
    return tuple(_view(seen, k) for k in best.values())


def _view(seen: DetectedPictures, k: int) -> DetectionView:
    # Imported late: only a page with pictures needs it.
    from PIL import Image

    taken, found = seen.pictures[k], seen.detections[k]
    image = taken.image
    grey = (picture_from(image) if isinstance(image, np.ndarray) else read_picture(image)).grey
    small = Image.fromarray(grey)
    small.thumbnail((WIDTH_PX, WIDTH_PX))
    file = io.BytesIO()
    small.save(file, "JPEG", quality=QUALITY)
    # Pixel centres are at integers: a share of a picture counts from half a pixel before.
    share = np.array(small.size) / np.array([grey.shape[1], grey.shape[0]])
    marks = (found.pixel.reshape(-1, 2) + 0.5) * share
    return DetectionView(taken.camera, taken.frame, file.getvalue(), small.size, marks)


def views_figures(views: Sequence[DetectionView]) -> str:
    """The pictures with a ring round each target."""
    return f'<div class="plots">{"".join(map(_figure, views))}</div>'


def _figure(view: DetectionView) -> str:
    width, height = view.size_px
    told = f"{view.camera}, {view.frame}: {len(view.marks_px)} targets"
    data = base64.b64encode(view.jpeg).decode("ascii")
    image = f'<image href="data:image/jpeg;base64,{data}" width="{width}" height="{height}"/>'
    rings = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{MARK_PX}"/>' for x, y in view.marks_px)
    return (
        f'<figure><svg viewBox="0 0 {width} {height}" role="img" aria-label="{esc(told)}">{image}'
        f'<g fill="none" stroke="#00c853" stroke-width="1.2">{rings}</g></svg>'
        f"<figcaption>{esc(told)}</figcaption></figure>"
    )
