"""Pictures ready for matching: undistorted, grey, with the pinhole camera that took them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from geometry.arrays import Floats, frozen
from geometry.camera import RigCamera, bends, distort
from geometry.frames import Pose

Singles = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Coded = NDArray[np.uint8] | NDArray[np.uint16]

SATURATED = 0.995
"""Share of the full scale from which on a grey value says no more than "bright"."""

_LARGEST_REMAP = 32_000
"""OpenCV's remap counts in 16 bits and refuses longer sides."""


@dataclass(frozen=True, eq=False)
class View:
    """One undistorted picture.

    ``grey`` (H, W) float32, 0 to 1, linear in whatever the camera delivered; NaN-free. ``colour``
    (H, W, 3) RGB, 8 bits. ``matrix`` (3, 3) the pinhole camera matrix with pixel centres at
    integers, ``pose`` the exterior orientation. ``clipped`` (H, W): saturated or outside the
    picture that was taken, so of no use to a matcher.
    """

    name: str
    grey: Singles
    colour: Bytes
    matrix: Floats
    pose: Pose
    clipped: NDArray[np.bool_]

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.grey.shape[1], self.grey.shape[0]

    def reduced(self) -> View:
        """The same view at half the resolution (area means of 2 x 2 pixels)."""
        h, w = self.grey.shape[0] // 2, self.grey.shape[1] // 2
        whole = (slice(2 * h), slice(2 * w))
        grey = cv2.resize(self.grey[whole], (w, h), interpolation=cv2.INTER_AREA)
        colour = cv2.resize(self.colour[whole], (w, h), interpolation=cv2.INTER_AREA)
        clipped = np.asarray(self.clipped[whole].reshape(h, 2, w, 2).any(axis=(1, 3)))
        # A reduced pixel's centre lies between two centres: (u - 0.5) / 2.
        scale = np.array([[0.5, 0.0, -0.25], [0.0, 0.5, -0.25], [0.0, 0.0, 1.0]])
        return View(
            self.name,
            np.asarray(grey, dtype=np.float32),
            np.asarray(colour, dtype=np.uint8),
            frozen(scale @ self.matrix),
            self.pose,
            clipped,
        )


@contextmanager
def memory_told() -> Iterator[None]:
    """OpenCV's own complaint about too little memory as Python's :class:`MemoryError`."""
    try:
        yield
    except cv2.error as error:
        if error.code == cv2.Error.StsNoMem:
            raise MemoryError from error
        raise


def view_of(image: Coded, camera: RigCamera) -> View:
    """A picture (H, W) or (H, W, 3) RGB, 8 or 16 bits, as a :class:`View`.

    Raises :class:`InputError` where the picture is not one of this camera.
    """
    kind = camera.camera
    if (image.shape[1], image.shape[0]) != kind.image_size_px:
        w, h = kind.image_size_px
        raise InputError(
            "picture-size",
            f"the picture of {camera.name} is {image.shape[1]} x {image.shape[0]} px, "
            f"its camera {w} x {h}",
            "give the pictures that this camera took, as it took them",
        )
    full = float(np.iinfo(image.dtype).max)
    colour = np.asarray(image) if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    grey = _grey(colour, full)
    clipped = np.asarray(colour.max(axis=2) >= SATURATED * full)
    eight: Bytes = np.asarray(colour // (256 if colour.dtype == np.uint16 else 1), dtype=np.uint8)
    matrix = np.asarray(kind.camera_matrix, dtype=np.float64)
    if bends(kind.distortion):
        grey, eight, clipped = _undistorted(grey, eight, clipped, matrix, kind.distortion)
    return View(camera.name, grey, eight, frozen(matrix), camera.pose, clipped)


def _grey(colour: NDArray[Any], full: float) -> Singles:
    """Mean of the channels: each carries noise of its own, so a mean is quieter than luma."""
    total: Singles = colour[..., 0].astype(np.float32)
    total += colour[..., 1]
    total += colour[..., 2]
    total *= np.float32(1.0 / (3.0 * full))
    return total


def _undistorted(
    grey: Singles, colour: Bytes, clipped: NDArray[np.bool_], matrix: Floats, distortion: Floats
) -> tuple[Singles, Bytes, NDArray[np.bool_]]:
    h, w = grey.shape
    if max(h, w) > _LARGEST_REMAP:
        raise InputError(
            "picture-size", f"pictures of {w} x {h} px are too large", "reduce them first"
        )
    u, v = np.meshgrid(np.arange(w, dtype=np.float64), np.arange(h, dtype=np.float64))
    plain = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1]], -1)
    bent = distort(plain.reshape(-1, 2), distortion).reshape(h, w, 2)
    columns = np.asarray(bent[..., 0] * matrix[0, 0] + matrix[0, 2], dtype=np.float32)
    rows = np.asarray(bent[..., 1] * matrix[1, 1] + matrix[1, 2], dtype=np.float32)
    smooth = cv2.remap(grey, columns, rows, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
    seen = cv2.remap(colour, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    lost = cv2.remap(
        clipped.astype(np.uint8), columns, rows, cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=1.0,
    )  # fmt: skip
    return np.asarray(smooth, np.float32), np.asarray(seen, np.uint8), np.asarray(lost > 0)
