"""Whether a lens fits a body, and what a rig file may take from the two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from common.errors import InputError, NotFoundError
from rig.catalogue.catalogue import Catalogue, PartT
from rig.catalogue.items import FIXED, CatalogueCamera, CatalogueLens

CIRCLE_SLACK = 1.02
"""Formats are nominal: a 1.1 inch sensor has 17.5 to 17.6 mm of diagonal."""

SHARP_PIXELS = 2.0
"""Default circle of confusion: two pixels, which is what demosaicing resolves."""


@dataclass(frozen=True)
class Fit:
    """How a lens sits on a body.

    ``adapter_mm`` is the thickness of the adapter, 0 without one. ``notes`` says what could not
    be checked because a figure is not known.
    """

    adapter: str
    adapter_mm: float
    notes: tuple[str, ...]


NO_ADAPTER = Fit("", 0.0, ())


def fit(
    catalogue: Catalogue,
    camera: CatalogueCamera,
    lens: CatalogueLens,
    diagonal_mm: float | None = None,
) -> Fit:
    """Check mount, flange and image circle; raises a one-line :class:`InputError`.

    ``diagonal_mm`` is that of the image used, when it is not the whole sensor's.
    """
    adapter, thickness = _mounting(catalogue, camera, lens)
    notes = []
    diagonal = camera.diagonal_mm if diagonal_mm is None else diagonal_mm
    circle = lens.image_circle_mm
    if lens.mount == FIXED:
        pass
    elif diagonal is None or circle is None:
        unknown = "sensor's size" if diagonal is None else "image circle"
        notes.append(f"whether {lens.id} covers {camera.id} was not checked: no {unknown} is known")
    elif diagonal > circle * CIRCLE_SLACK:
        raise InputError(
            "lens-circle",
            f"lens {lens.id} covers {circle:g} mm, but the image of {camera.id} has a diagonal of "
            f"{diagonal:.1f} mm",
            _suggest(catalogue, camera, lens) + " or give a smaller image_size_px",
        )
    return Fit(adapter, thickness, tuple(notes))


def _mounting(
    catalogue: Catalogue, camera: CatalogueCamera, lens: CatalogueLens
) -> tuple[str, float]:
    if camera.mount == FIXED:
        if camera.fixed_lens == lens.id:
            return "", 0.0
        own = f"give lens = {camera.fixed_lens!r}" if camera.fixed_lens else "choose another body"
        raise InputError(
            "lens-mount", f"the lens of {camera.id} cannot be changed for {lens.id}", own
        )
    if lens.mount == camera.mount:
        return "", 0.0
    body = catalogue.mounts[camera.mount]
    for adapter in body.adapters:
        if adapter.lens == lens.mount:
            return adapter.name, _thickness(catalogue, camera.mount, lens.mount)
    raise InputError(
        "lens-mount",
        f"lens {lens.id} is made for the mount {lens.mount}, {camera.id} has {camera.mount}",
        _suggest(catalogue, camera, lens),
    )


def _thickness(catalogue: Catalogue, body: str, lens: str) -> float:
    near, far = catalogue.mounts[body].flange_mm, catalogue.mounts[lens].flange_mm
    if near is None or far is None or far < near:
        raise InputError(
            "lens-flange",
            f"no adapter can hold a {lens} lens before a {body} mount",
            "correct the flange_mm of the two mounts",
        )
    return far - near


def _suggest(catalogue: Catalogue, camera: CatalogueCamera, lens: CatalogueLens) -> str:
    """The lenses that go on the body and cover it, nearest in focal length."""
    need = camera.diagonal_mm
    taken = {camera.mount}
    if camera.mount in catalogue.mounts:
        taken |= {adapter.lens for adapter in catalogue.mounts[camera.mount].adapters}
    fitting = [
        other
        for other in catalogue.lenses.values()
        if other.mount in taken
        and (
            need is None
            or other.image_circle_mm is None
            or need <= other.image_circle_mm * CIRCLE_SLACK
        )
    ]
    fitting.sort(key=lambda other: abs(other.focal_length_mm - lens.focal_length_mm))
    if not fitting:
        return "choose another body"
    return f"choose {' or '.join(other.id for other in fitting[:2])}"


def parts_named(
    catalogue: Catalogue, model: str | None, lens: str | None
) -> tuple[CatalogueCamera | None, CatalogueLens | None]:
    """The parts a rig file names; a built-in lens needs no name of its own.

    Raises :class:`InputError` with the nearest parts for a name that is not there.
    """
    body = None if model is None else _named(catalogue.camera, "model", model)
    glass = None if lens is None else _named(catalogue.lens, "lens", lens)
    if body is not None and glass is None and body.fixed_lens is not None:
        glass = catalogue.lenses[body.fixed_lens]
    return body, glass


def _named(find: Callable[[str], PartT], key: str, wanted: str) -> PartT:
    try:
        return find(wanted)
    except NotFoundError as error:
        raise InputError(
            "catalogue-part", f"{key} {wanted!r} is not in the catalogue", error.remedy
        ) from error


def camera_values(
    body: CatalogueCamera | None, lens: CatalogueLens | None, fitted: Fit, flange_mm: float | None
) -> dict[str, Any]:
    """What the parts say about a ``[camera]`` section, as its keys; unknown ones are absent.

    ``flange_mm`` is the distance from the body's flange to the sensor.
    """
    values: dict[str, Any] = {}
    if body is not None:
        pitch = body.pitch_um
        values["image_size_px"] = list(body.image_size_px)
        values["pixel_pitch_um"] = pitch
        values["circle_of_confusion_um"] = None if pitch is None else SHARP_PIXELS * pitch
    if lens is not None:
        values["focal_length_mm"] = lens.focal_length_mm
        if lens.f_number_min is not None and lens.f_number_min == lens.f_number_max:
            values["f_number"] = lens.f_number_min
        values["min_focus_mm"] = _min_focus_mm(body, lens, fitted, flange_mm)
    values["body"] = _body_values(body, lens, fitted)
    if body is not None and lens is not None:
        values["name"] = f"{body.id} {lens.id}"[:80]
    return {key: value for key, value in values.items() if value is not None}


def _stand_mm(body: CatalogueCamera | None) -> float:
    return 0.0 if body is None or body.flange_stand_mm is None else body.flange_stand_mm


def _reach_mm(body: CatalogueCamera | None, lens: CatalogueLens, fitted: Fit) -> float | None:
    """How far the lens reaches out of the body's front, adapter and all."""
    if lens.mount == FIXED:
        return 0.0
    if lens.length_mm is None:
        return None
    return _stand_mm(body) + fitted.adapter_mm + lens.length_mm


def pupil_mm(body: CatalogueCamera | None, lens: CatalogueLens, fitted: Fit) -> float | None:
    """From the body's front forward to the entrance pupil; half-way along the lens if unknown."""
    if lens.entrance_pupil_mm is not None:
        return _stand_mm(body) + fitted.adapter_mm + lens.entrance_pupil_mm
    reach = _reach_mm(body, lens, fitted)
    return None if reach is None else reach / 2.0


def _min_focus_mm(
    body: CatalogueCamera | None, lens: CatalogueLens, fitted: Fit, flange_mm: float | None
) -> float | None:
    """The nearest focus counted from the entrance pupil, as rig files have it."""
    reach, pupil = _reach_mm(body, lens, fitted), pupil_mm(body, lens, fitted)
    if lens.min_focus_mm is None or reach is None or pupil is None:
        return None
    if lens.min_focus_from == "front":
        return lens.min_focus_mm + reach - pupil
    if flange_mm is None:
        return None
    return lens.min_focus_mm - flange_mm - (pupil - _stand_mm(body))


def _body_values(
    body: CatalogueCamera | None, lens: CatalogueLens | None, fitted: Fit
) -> dict[str, Any] | None:
    values: dict[str, Any] = {}
    if body is not None and body.body_size_mm is not None:
        values["size_mm"] = list(body.body_size_mm)
    pupil = None
    if lens is not None:
        reach, pupil = _reach_mm(body, lens, fitted), pupil_mm(body, lens, fitted)
        if reach and lens.diameter_mm is not None:
            values |= {"lens_diameter_mm": lens.diameter_mm, "lens_length_mm": reach}
        if pupil is not None and lens.entrance_pupil_mm is not None and "size_mm" in values:
            values["centre_mm"] = [0.0, 0.0, -(pupil + values["size_mm"][2] / 2.0)]
    if body is not None and body.thread_mm is not None and pupil is not None:
        x, y, z = body.thread_mm
        values["mount_thread_mm"] = [x, y, z + _stand_mm(body) - pupil]
    return values or None
