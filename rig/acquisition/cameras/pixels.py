"""Raw buffers of industrial cameras as images. Names of formats follow the PFNC of the EMVA.

Values of 10, 12 and 14 bits are moved up to fill 16, so that white is white in every file.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rig.acquisition.cameras.base import Image

_SINGLE = re.compile(r"(Mono|BayerRG|BayerGR|BayerGB|BayerBG)(8|10|12|14|16)(p?)")
_CHANNELS = {
    "RGB8": (0, 1, 2),
    "BGR8": (2, 1, 0),
    "RGBa8": (0, 1, 2),
    "BGRa8": (2, 1, 0),
}
_OLD_NAMES = {"RGB8Packed": "RGB8", "BGR8Packed": "BGR8", "RGBA8Packed": "RGBa8"}


def understood(pixel_format: str) -> bool:
    """Whether :func:`decode` can read buffers of this format."""
    name = _OLD_NAMES.get(pixel_format, pixel_format)
    single = _SINGLE.fullmatch(name)
    return name in _CHANNELS or bool(single and not (single[3] and single[2] in ("8", "16")))


def decode(pixel_format: str, width_px: int, height_px: int, buffer: bytes) -> Image:
    """The image in a buffer: (H, W) for Mono, (H, W, 3) RGB for colour and Bayer formats.

    Bayer mosaics are interpolated by OpenCV (bilinear). Bytes after the image are ignored.
    Raises ValueError for an unknown format and for a buffer that is too short.
    """
    name = _OLD_NAMES.get(pixel_format, pixel_format)
    if name in _CHANNELS:
        order = _CHANNELS[name]
        samples = 4 if "a" in name else 3
        flat = _take(np.frombuffer(buffer, np.uint8), width_px * height_px * samples)
        return np.ascontiguousarray(flat.reshape(height_px, width_px, samples)[:, :, order])
    single = _SINGLE.fullmatch(name)
    if not single or not understood(name):
        raise ValueError(f"pixel format {pixel_format} is not understood")
    bits = int(single[2])
    image = _unpack(buffer, bits, bool(single[3]), width_px * height_px).reshape(
        height_px, width_px
    )
    return image if single[1] == "Mono" else _interpolate(single[1], image)


def _unpack(buffer: bytes, bits: int, packed: bool, count: int) -> Image:
    if bits == 8:
        return _take(np.frombuffer(buffer, np.uint8), count)
    if packed:
        return _unpack_bits(buffer, bits, count)
    usable = len(buffer) // 2 * 2
    values = _take(np.frombuffer(buffer[:usable], "<u2"), count)
    return np.left_shift(values, 16 - bits).astype(np.uint16)


def _unpack_bits(buffer: bytes, bits: int, count: int) -> NDArray[np.uint16]:
    """Samples packed without gaps, lowest bits first (the PFNC's ``p`` formats)."""
    flat = np.unpackbits(np.frombuffer(buffer, np.uint8), bitorder="little")
    samples = _take(flat, count * bits).reshape(count, bits).astype(np.uint16)
    places = np.left_shift(1, np.arange(16 - bits, 16)).astype(np.uint16)
    return (samples @ places).astype(np.uint16)


def _take(values: NDArray[np.uint8], count: int) -> NDArray[np.uint8]:
    if len(values) < count:
        raise ValueError(f"the buffer holds {len(values)} values of {count}")
    return values[:count]


def _interpolate(pattern: str, mosaic: Image) -> Image:
    import cv2

    # OpenCV names a pattern by its second row and column: its BG is everybody else's RG.
    codes = {
        "BayerRG": cv2.COLOR_BayerBG2RGB,
        "BayerGR": cv2.COLOR_BayerGB2RGB,
        "BayerGB": cv2.COLOR_BayerGR2RGB,
        "BayerBG": cv2.COLOR_BayerRG2RGB,
    }
    convert: Callable[..., Image] = cv2.cvtColor  # type: ignore[assignment]  # its types say more
    return convert(np.ascontiguousarray(mosaic), codes[pattern])
