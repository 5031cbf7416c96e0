"""What every export shares: its options, its files, and which cameras it accepts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from common.errors import InputError
from geometry.camera import LensModel, RigCamera

Cameras = tuple[RigCamera, ...]
Files = Mapping[str, bytes]
"""File contents by name relative to the export's folder."""

PosePrior = Literal["initial", "exact", "locked"]
POSE_PRIORS: tuple[PosePrior, ...] = ("initial", "exact", "locked")


@dataclass(frozen=True)
class ExportOptions:
    """What a target program must be told besides the cameras.

    ``image_suffix`` completes the camera's name to the name of its image file.
    ``pose_prior`` says how far RealityScan may move the cameras; ``locked`` claims that the
    rig stands within a thousandth of a millimetre of its design. Raises :class:`InputError`.
    """

    image_suffix: str = ".png"
    pose_prior: PosePrior = "initial"

    def __post_init__(self) -> None:
        suffix = self.image_suffix
        if not suffix.startswith(".") or not suffix[1:].isalnum():
            raise InputError(
                "export-suffix",
                f"{suffix!r} is not the ending of an image file's name",
                "give one like .png or .jpg",
            )
        if self.pose_prior not in POSE_PRIORS:
            raise InputError(
                "export-prior",
                f"there is no pose prior {self.pose_prior!r}",
                f"choose one of {', '.join(POSE_PRIORS)}",
            )


@dataclass(frozen=True)
class Format:
    """One export: what it is for, which files it makes, and how.

    ``files`` names them for a listing; ``{image}`` stands for one file per camera. ``write``
    makes their contents from checked cameras. ``lenses``: which lens models the format can say.
    """

    name: str
    program: str
    description: str
    files: tuple[str, ...]
    write: Callable[[Cameras, ExportOptions], Files]
    lenses: tuple[LensModel, ...] = (LensModel.BROWN,)


def image_stem(camera_name: str) -> str:
    """The camera's name as a file name without blanks: COLMAP's text files split at blanks."""
    return "_".join(camera_name.split())


def image_name(camera: RigCamera, options: ExportOptions) -> str:
    """Name of the image file that belongs to ``camera``."""
    return image_stem(camera.name) + options.image_suffix


def check_cameras(cameras: Cameras) -> None:
    """Raise :class:`InputError` when the cameras cannot be told apart, or there are none."""
    if not cameras:
        raise InputError("export-empty", "there are no cameras to export", "give a design")
    owners: dict[str, str] = {}
    for camera in cameras:
        stem = image_stem(camera.name)
        if not stem.isprintable() or set(stem) & set("/\\") or stem.startswith(".") or not stem:
            raise InputError(
                "export-name",
                f"camera {camera.name!r} cannot give its name to an image file",
                "give it a name of letters, digits, blanks, dots and hyphens",
            )
        if stem in owners:
            raise InputError(
                "export-name",
                f"cameras {owners[stem]!r} and {camera.name!r} would share the image {stem}",
                "give each a name of its own",
            )
        owners[stem] = camera.name


def check_lenses(cameras: Cameras, form: Format) -> None:
    """Raise :class:`InputError` for a lens that the format has no words for."""
    for camera in cameras:
        lens = camera.camera.lens_model
        if lens not in form.lenses:
            raise InputError(
                "export-lens-model",
                f"{form.name} has no {lens.name.lower()} lens, and camera {camera.name!r} has one",
                "export to opencv or colmap-text, which have, or calibrate with --model brown",
            )
