"""A glance at each picture: can it be read, how large is it, is there anything on it."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO

import numpy as np

from rig.acquisition.cameras.base import Frame, Image
from rig.acquisition.imaging import glanced
from rig.acquisition.synchrony.cameraframes import Pairing
from rig.acquisition.synchrony.faults import Fault, FaultKind

BLACK_SHARE = {8: 1.0 / 16.0, 16: 1.0 / 50.0}
"""A picture whose 99.9th percentile stays below this share of full scale shows nothing, by bits.

8 bits are gamma coded, 16 bits mostly linear and moved up to fill their range. The noise and
offset of a dark frame stay below, the lit side of a face far above.
"""

STRIDE = 3
"""Every third row and column decide about blackness: enough of any face, a ninth of the work."""

READABLE_TYPES = ("image/jpeg", "image/png", "image/tiff")
"""What is read to be looked at. Raw files are filed as they came."""


@dataclass(frozen=True)
class ImageCheck:
    """What a glance showed. ``size_px`` (width, height) None where it could not be read."""

    size_px: tuple[int, int] | None
    black: bool = False
    readable: bool = True
    cut_off: bool = False
    """Whether the file ends before its picture does."""


def is_raw(frame: Frame) -> bool:
    """Whether a frame is a file of a kind that is filed beside the pictures, unread."""
    return frame.encoded is not None and frame.media_type not in READABLE_TYPES


def check_image(frame: Frame) -> ImageCheck:
    """Glance at one picture."""
    if frame.pixels is not None:
        height, width = frame.pixels.shape[:2]
        return ImageCheck((width, height), _black(frame.pixels))
    if frame.encoded is None:
        return ImageCheck(None, readable=False)
    if is_raw(frame):
        return ImageCheck(None)
    return _check_file(frame.encoded)


def _check_file(data: bytes) -> ImageCheck:
    from PIL import Image as Pictures

    # Behind the end mark some bodies add a few bytes of their own.
    cut = data[:2] == b"\xff\xd8" and b"\xff\xd9" not in data[-4096:]
    try:
        size = Pictures.open(BytesIO(data)).size
    except (OSError, SyntaxError, ValueError):
        # Each damaged file makes the library throw something else.
        return ImageCheck(None, readable=False, cut_off=cut)
    # An eighth each way is enough to see whether there is anything, and decodes in no time.
    # The decoder fills what is missing of a JPEG that was cut off with grey.
    pixels = None if cut else glanced(data)
    if pixels is None:
        return ImageCheck(size if cut else None, readable=False, cut_off=cut)
    return ImageCheck(size, _black(pixels))


def _black(pixels: Image) -> bool:
    depth = np.iinfo(pixels.dtype)
    thin = pixels[::STRIDE, ::STRIDE]
    return bool(np.percentile(thin, 99.9) < BLACK_SHARE[depth.bits] * float(depth.max))


def image_faults(pairing: Pairing, size_px: tuple[int, int] | None) -> list[Fault]:
    """What is wrong with the pictures of one camera that were given to shots."""
    faults = []
    for one in pairing.pairs:
        look = check_image(one.frame)
        name, shot = pairing.camera, one.shot
        which = f"{name}: the picture of shot {shot}"
        if not look.readable:
            text = f"{which} {'was cut off on its way' if look.cut_off else 'cannot be read'}"
            faults.append(Fault(FaultKind.UNREADABLE, text, name, shot))
        if look.black:
            text = f"{which} is black; check the flash, the lens cap and the exposure"
            faults.append(Fault(FaultKind.BLACK, text, name, shot))
        if look.size_px is not None and size_px is not None and look.size_px != size_px:
            is_, should = "{} x {}".format(*look.size_px), "{} x {}".format(*size_px)
            text = f"{which} has {is_} pixels, {should} are expected"
            faults.append(Fault(FaultKind.WRONG_SIZE, text, name, shot))
    return faults
