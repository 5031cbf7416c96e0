"""Pictures as detection takes them: grey, of 8 or 16 bits, whole."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.detection import opencv
from calibration.detection.opencv import AnyImage, Bytes
from common.errors import InputError
from common.files.reading import plain_size

if TYPE_CHECKING:
    from PIL.Image import Image

LARGEST_BYTES = 500_000_000
LARGEST_PIXELS = 400_000_000
"""Beyond any camera; a few kilobytes may claim more, and take all memory when they are decoded."""

_TAKEN = "give grey or colour pictures of 8 or 16 bits as JPEG, PNG or TIFF"


@dataclass(frozen=True, eq=False)
class Picture:
    """A grey picture: ``levels`` (H, W) as the camera gave them, ``grey`` (H, W) of 8 bits.

    ``levels * gain`` is in grey levels of 255.
    """

    levels: AnyImage
    grey: Bytes
    gain: float

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.grey.shape[1], self.grey.shape[0]

    @property
    def mirrored(self) -> Picture:
        """The picture with left and right exchanged."""
        return Picture(self.levels[:, ::-1], np.ascontiguousarray(self.grey[:, ::-1]), self.gain)

    @property
    def negative(self) -> Picture:
        """The picture with black and white exchanged."""
        top = self.levels.dtype.type(round(255.0 / self.gain))
        return Picture(top - self.levels, 255 - self.grey, self.gain)


def picture_from(image: AnyImage, name: str = "the picture", order: str = "BGR") -> Picture:
    """A picture from an array (H, W), (H, W, 1), (H, W, 3) or (H, W, 4), ``order`` RGB or BGR.

    A fourth channel must be opaque everywhere. 16 bits may be filled from below (10, 12 or 14
    bits used). Raises a one-line :class:`InputError` naming the picture.
    """
    image = np.asarray(image)
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError("image-depth", f"{name} has pixels of type {image.dtype}", _TAKEN)
    channels = image.shape[2] if image.ndim == 3 else 1
    if image.ndim not in (2, 3) or channels not in (1, 3, 4) or min(image.shape[:2]) < 16:
        raise InputError("image-shape", f"{name} has the shape {image.shape}", _TAKEN)
    if channels == 4 and int(image[..., 3].min()) != np.iinfo(image.dtype).max:
        raise InputError(
            "image-channels",
            f"{name} has a fourth channel that is not opaque",
            "save it without transparency, and not as CMYK",
        )
    levels = image.reshape(image.shape[:2]) if channels == 1 else opencv.to_grey(image, order)
    if levels.dtype == np.uint8:
        grey = np.ascontiguousarray(levels)
        return Picture(grey, grey, 1.0)
    bits = max(8, int(levels.max()).bit_length())
    gain = 255.0 / (2**bits - 1)
    return Picture(levels, np.rint(levels * gain).astype(np.uint8), gain)


def read_picture(path: Path, name: str | None = None) -> Picture:
    """The picture in a file. Raises a one-line :class:`InputError` with its ``name``."""
    name = path.name if name is None else name
    return decoded(_bytes_of(path, name), name)


def read_colour(path: Path) -> AnyImage:
    """The pixels in a file, (H, W) or (H, W, 3) RGB, 8 or 16 bits; errors as of a picture."""
    image = _pixels(_bytes_of(path, path.name), path.name)
    picture_from(image, path.name)  # what cannot be measured is refused in the same words
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., 2::-1])


def _bytes_of(path: Path, name: str) -> bytes:
    try:
        if plain_size(path) > LARGEST_BYTES:
            raise InputError("image-size", f"{name} is larger than a picture", _TAKEN)
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            "image-read", f"{name} cannot be read ({error.strerror})", "check the path"
        ) from error


def decoded(data: bytes, name: str) -> Picture:
    """The picture in an encoded file. Raises a one-line :class:`InputError` naming it."""
    return picture_from(_pixels(data, name), name)


def _pixels(data: bytes, name: str) -> AnyImage:
    _check_size(data, name)
    if data[:2] == b"\xff\xd8":
        _check_jpeg(data, name)
    image = opencv.decode(data) if data else None
    if image is None:
        raise InputError("image-format", f"{name} is not a picture that can be read", _TAKEN)
    return image


@contextmanager
def _opened(data: bytes) -> Iterator[Image]:
    """The file's header as Pillow reads it; its own limit on size is not ours."""
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        with Image.open(io.BytesIO(data)) as image:
            yield image


def _check_size(data: bytes, name: str) -> None:
    from PIL import Image

    try:
        with _opened(data) as image:
            pixels = image.width * image.height
    except Image.DecompressionBombError:
        pixels = LARGEST_PIXELS + 1
    except (OSError, SyntaxError, ValueError):
        return  # what Pillow cannot read OpenCV may, or says so itself
    if pixels > LARGEST_PIXELS:
        problem = f"{name} claims more than {LARGEST_PIXELS // 10**6} million pixels"
        raise InputError("image-size", problem, _TAKEN)


def _check_jpeg(data: bytes, name: str) -> None:
    """OpenCV fills what is missing of a broken JPEG with grey and says nothing; Pillow tells."""
    try:
        with _opened(data) as image:
            if image.mode not in ("L", "RGB"):
                raise InputError("image-channels", f"{name} is a {image.mode} JPEG", _TAKEN)
            image.draft("L", (image.width // 8, image.height // 8))
            image.load()
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(
            "image-corrupt", f"{name} is a broken JPEG", "copy it from the camera again"
        ) from error
