"""What a ``[camera]`` section takes from the catalogue when it names parts.

Keys that the section gives go before the catalogue's, as long as they do not contradict it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeGuard

from common.errors import InputError
from rig.catalogue import Catalogue, CatalogueCamera, CatalogueLens, fit, load_catalogue
from rig.catalogue.fitting import NO_ADAPTER, camera_values, parts_named
from rig.catalogue.items import MICROMETRES

CATALOGUE = "catalogue"
"""Key under which a validation's context holds the catalogue to use."""

SENSOR_SLACK = 1.01
"""Published sensor sizes are rounded to a tenth of a millimetre."""

FOCAL_SLACK = 0.2
"""A calibrated focal length is within a few per cent of the nominal one."""


def with_parts(data: Mapping[str, Any], catalogue: Catalogue | None) -> dict[str, Any]:
    """The section with what its ``model`` and ``lens`` say where it says nothing itself.

    Raises :class:`ValueError` in one line for parts that are not there, do not fit each other,
    or contradict the keys given.
    """
    model, lens = data.get("model"), data.get("lens")
    named = [part for part in (model, lens) if part is not None]
    if not named or not all(isinstance(part, str) and part for part in named):
        return dict(data)
    catalogue = catalogue or load_catalogue()
    try:
        values = _values(data, catalogue, model, lens)
    except InputError as error:
        # Only a ValueError carries the file and the key it stands at into the one-line message.
        raise ValueError(str(error)) from error
    return values


def _values(
    data: Mapping[str, Any], catalogue: Catalogue, model: str | None, lens: str | None
) -> dict[str, Any]:
    body, glass = parts_named(catalogue, model, lens)
    mount = (body or glass).mount  # type: ignore[union-attr]
    flange = catalogue.mounts[mount].flange_mm if mount in catalogue.mounts else None
    fitted = NO_ADAPTER
    if body is not None and glass is not None:
        fitted = fit(catalogue, body, glass, _diagonal_mm(data, body))
    values = camera_values(body, glass, fitted, flange)
    solid, own = values.pop("body", None), data.get("body")
    merged = {**values, **data}
    if solid is not None and (own is None or isinstance(own, Mapping)):
        merged["body"] = _merged_body(solid, own or {})
    if body is not None:
        _check_sensor(merged, body)
    if glass is not None:
        _check_lens(merged, glass)
    return merged


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _extent_mm(values: Mapping[str, Any], pitch_um: object) -> tuple[float, float] | None:
    """Width and height of the image on the sensor; None while either is not a number yet."""
    size = values.get("image_size_px")
    if not isinstance(size, list) or len(size) != 2 or not all(map(_is_number, size)):
        return None
    if not _is_number(pitch_um):
        return None
    pitch_mm = pitch_um / MICROMETRES
    return size[0] * pitch_mm, size[1] * pitch_mm


def _diagonal_mm(data: Mapping[str, Any], body: CatalogueCamera) -> float | None:
    """Diagonal of the image that is used: a smaller one needs a smaller image circle."""
    extent = _extent_mm(data, data.get("pixel_pitch_um", body.pitch_um))
    return body.diagonal_mm if extent is None else math.hypot(*extent)


def _merged_body(solid: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """The catalogue's solid with the file's keys; another depth moves its centre along."""
    merged = {**solid, **own}
    size = own.get("size_mm")
    if "centre_mm" in solid and "centre_mm" not in own and size is not None:
        if isinstance(size, list) and len(size) == 3 and _is_number(size[2]):
            x, y, z = solid["centre_mm"]
            merged["centre_mm"] = [x, y, z + (solid["size_mm"][2] - size[2]) / 2.0]
        else:
            del merged["centre_mm"]
    return merged


def _check_sensor(merged: Mapping[str, Any], body: CatalogueCamera) -> None:
    sensor = body.active_size_mm
    extent = _extent_mm(merged, merged.get("pixel_pitch_um"))
    if sensor is None or extent is None:
        return
    if any(side > limit * SENSOR_SLACK for side, limit in zip(extent, sensor, strict=True)):
        width, height = body.image_size_px
        raise InputError(
            "value",
            f"image_size_px and pixel_pitch_um make {extent[0]:.1f} x {extent[1]:.1f} mm, but the "
            f"sensor of {body.id} has {sensor[0]:.1f} x {sensor[1]:.1f} mm",
            f"leave them out for {width} x {height} pixels, or give smaller ones",
        )


def _check_lens(merged: Mapping[str, Any], lens: CatalogueLens) -> None:
    f_number, focal = merged.get("f_number"), merged.get("focal_length_mm")
    low, high = lens.f_number_min or 0.0, lens.f_number_max or math.inf
    if _is_number(f_number) and not low - 0.05 <= f_number <= high + 0.05:
        ends = f"from {low:g} to {high:g}" if high < math.inf else f"{low:g} and up"
        nearest = low if f_number < low else high
        raise InputError(
            "value",
            f"f_number is {f_number:g}, but {lens.id} has {ends}",
            f"give {nearest:g} or choose another lens",
        )
    nominal = lens.focal_length_mm
    if _is_number(focal) and abs(focal / nominal - 1.0) > FOCAL_SLACK:
        raise InputError(
            "value",
            f"focal_length_mm is {focal:g}, but {lens.id} has {nominal:g}",
            "leave it out, or give the calibrated focal length of this lens",
        )
