"""From a frame to the bytes of its file."""

from __future__ import annotations

import mimetypes
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from PIL import Image

from common.errors import InputError
from rig.acquisition.cameras.base import Frame
from rig.acquisition.cameras.base import Image as Pixels
from rig.acquisition.imaging import png
from rig.acquisition.session.exif import PictureFacts, exif_of, png_with_exif, with_exif
from rig.acquisition.station.spec import CapturePolicy, ImageFormat

SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png", "image/tiff": ".tif"}


@dataclass(frozen=True)
class Filed:
    """A file to be written. ``as_png``: it was to be something that cannot hold it."""

    data: bytes
    suffix: str
    media_type: str
    as_png: bool = False


def filed(frame: Frame, facts: PictureFacts, policy: CapturePolicy) -> Filed:
    """The file of one frame: a camera's own file as it came, pixels as the policy says.

    Raises :class:`InputError` for a frame without a picture.
    """
    if frame.encoded is not None:
        data = frame.encoded
        if frame.media_type == "image/jpeg":
            data = with_exif(data, facts)
        return Filed(data, _suffix(frame.media_type), frame.media_type)
    if frame.pixels is None:
        raise InputError("frame-empty", "a frame holds no picture", "see to the camera's backend")
    return _coded(frame.pixels, facts, policy)


def _suffix(media_type: str) -> str:
    known = SUFFIXES.get(media_type) or mimetypes.guess_extension(media_type)
    # Raw files of makers are image/x-nikon-nef and the like.
    return known or "." + media_type.rsplit("/", 1)[-1].rsplit("-", 1)[-1].rsplit(".", 1)[-1]


def _coded(pixels: Pixels, facts: PictureFacts, policy: CapturePolicy) -> Filed:
    deep = pixels.dtype == np.uint16
    wanted = policy.image_format
    cannot = deep and (
        wanted is ImageFormat.JPEG or (wanted is ImageFormat.TIFF and _colour(pixels))
    )
    if wanted is ImageFormat.PNG or cannot:
        return Filed(_png(pixels, facts), ".png", "image/png", as_png=cannot)
    buffer = BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    if wanted is ImageFormat.TIFF:
        # As bytes: from an object Pillow takes the main tags only.
        picture.save(buffer, "TIFF", exif=exif_of(facts).tobytes())
        return Filed(buffer.getvalue(), ".tif", "image/tiff")
    # 4:4:4: thinned-out colour would blur what dense matching looks at.
    picture.save(buffer, "JPEG", quality=policy.jpeg_quality, subsampling=0, exif=exif_of(facts))
    return Filed(buffer.getvalue(), ".jpg", "image/jpeg")


def _colour(pixels: Pixels) -> bool:
    return pixels.ndim == 3


def _png(pixels: Pixels, facts: PictureFacts) -> bytes:
    data = png(pixels)
    if data is None:
        raise InputError("frame-shape", "a frame cannot be coded", "see to the camera's backend")
    return png_with_exif(data, facts)
