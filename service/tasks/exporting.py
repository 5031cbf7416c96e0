"""Cameras of designs and calibrations, as other programs want them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from calibration.exports import rig_cameras
from calibration.files import read_calibration
from geometry.camera import RigCamera
from geometry.exchange import FORMATS, Format, export_files
from rig.design.designfile import read_design


def export_formats() -> tuple[Format, ...]:
    """All ways to write cameras."""
    return tuple(FORMATS.values())


def designed_cameras(design: Path) -> tuple[RigCamera, ...]:
    """The cameras of a design file. Raises :class:`~common.errors.InputError`."""
    return read_design(design).cameras


def calibrated_cameras(calibration: Path, design: Path | None) -> tuple[RigCamera, ...]:
    """The cameras of a calibration file.

    Where it began from a ``design``, pixel pitch and body are the design's.
    Raises :class:`~common.errors.InputError`.
    """
    like = () if design is None else designed_cameras(design)
    return rig_cameras(read_calibration(calibration).calibration.cameras, like)


def exported(form: str, cameras: tuple[RigCamera, ...]) -> Mapping[str, bytes]:
    """The files of one export by name. Raises :class:`~common.errors.NotFoundError`."""
    return export_files(form, cameras)
