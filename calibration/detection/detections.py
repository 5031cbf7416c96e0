"""What detection says about one picture."""

from __future__ import annotations

from dataclasses import dataclass

from calibration.detection.gates import Rejection
from common.errors import InputError
from geometry.arrays import Floats, frozen

SIGMA_FLOOR_PX = 0.01
"""Added in squares to the sigma of each fit: fits of a hundredth of a pixel tell of the noise,
but lenses, paper and sensors are not even to much better than that."""


@dataclass(frozen=True)
class PictureProblem:
    """Something about the whole picture that explains why targets are missing.

    ``code`` is a stable slug: mirrored, legacy, swapped, other-board, inverted, dictionary, dark,
    bright, soft, unpaired, none.
    """

    code: str
    problem: str
    remedy: str

    def error(self, name: str) -> InputError:
        """The finding as the one-line error about a picture or a camera."""
        return InputError(f"targets-{self.code}", f"{name}: {self.problem}", self.remedy)


@dataclass(frozen=True, eq=False)
class Detections:
    """Targets found in one picture.

    ``ids`` (n) are names from the target set; ``pixel`` (n, 2) with pixel centres at integers;
    ``sigma_px`` (n, 2); ``blur_px`` (n,) sigma of the blur, lens and pixel together.
    """

    image_size_px: tuple[int, int]
    ids: tuple[str, ...]
    pixel: Floats
    sigma_px: Floats
    blur_px: Floats
    rejections: tuple[Rejection, ...] = ()
    findings: tuple[PictureProblem, ...] = ()

    def __post_init__(self) -> None:
        for name in ("pixel", "sigma_px", "blur_px"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True)
class Point:
    """One target found."""

    target: str
    pixel: tuple[float, float]
    sigma_px: tuple[float, float]
    blur_px: float
