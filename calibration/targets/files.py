"""Target files: a target set as TOML that people read and write."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from calibration.observations import Distance
from calibration.targets.boards import AnyBoard, AprilGrid, Board, Chessboard, DotGrid
from calibration.targets.filekeys import (
    AprilGridModel,
    ChessboardModel,
    DotGridModel,
    MarkersModel,
    PlateModel,
    RingsModel,
    RulerModel,
    TargetPlaceModel,
    TargetsModel,
)
from calibration.targets.kinds import (
    UNKNOWN_MM,
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlace,
    TargetPlan,
    marker_numbers,
)
from calibration.targets.ringcodes import RingCodeFamily
from calibration.targets.rulers import Ruler
from common.errors import InputError
from common.files import toml
from common.files.strict import as_json
from common.files.toml import read_text
from common.files.writing import write_whole

SCHEMA = "rigwright.targets/1"
LARGEST_BYTES = 5_000_000
PLACE_SIGMA_MM = (0.1, 0.1, 0.1)
"""What is taken for a place that is given without a sigma."""


def read_targets(path: Path) -> TargetPlan:
    """The target set in a file. Raises a one-line :class:`InputError` naming the file."""
    return targets_from(read_text(path, "targets", "target file", LARGEST_BYTES), path.name)


def targets_from(text: str, source: str = "the target file") -> TargetPlan:
    """The target set in a file's text. Raises a one-line :class:`InputError` naming it."""
    data = toml.parsed(text, source, "targets", "target file")
    return targets_of(as_json(TargetsModel, data, source))


def targets_of(model: TargetsModel) -> TargetPlan:
    """The target set that a file's model describes. Raises :class:`InputError`."""
    carriers: list[CarrierKind] = [CharucoPlate(**_with_ruler(m)) for m in model.plates]
    carriers += [Chessboard(**_with_ruler(m)) for m in model.chessboards]
    carriers += [AprilGrid(**_with_ruler(m)) for m in model.aprilgrids]
    carriers += [DotGrid(**_with_ruler(m)) for m in model.dot_grids]
    carriers += [_markers(m) for m in model.markers]
    carriers += [_rings(m) for m in model.rings]
    distances = tuple(Distance(**m.model_dump()) for m in model.distances)
    for carrier in carriers:
        _check_markers(carrier)
        _check_units(carrier)
    return TargetPlan(model.name, tuple(carriers), distances)


def targets_text(plan: TargetPlan) -> str:
    """A target set as a file's text; values that are as usual are left out.

    A file has plates and boards first, then markers, then ring targets, and is read in that order.
    """
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment("Coded targets. Lengths in millimetres, as drawn; a ruler says"))
    document.add(tomlkit.comment("how large they came out: ruler = { drawn_mm, measured_mm }."))
    document["schema"] = SCHEMA
    document["name"] = plan.name
    tables: dict[str, list[dict[str, Any]]] = {key: [] for key in _TABLES}
    for carrier in plan.carriers:
        key, model = _model(carrier)
        tables[key].append(model.model_dump(exclude_defaults=True))
    tables["distances"] = [vars(d) for d in plan.distances]
    for key, rows in tables.items():
        array = tomlkit.aot()
        for row in rows:
            array.append(_table(row))
        if rows:
            document[key] = array
    return str(tomlkit.dumps(document))


def write_targets(plan: TargetPlan, path: Path, overwrite: bool = False) -> None:
    """Write a target file, whole or not at all."""
    write_whole(path, targets_text(plan).encode(), overwrite)


def _check_markers(carrier: CarrierKind) -> None:
    """Markers that the dictionary does not have."""
    from calibration.detection import opencv

    for dictionary, number in sorted(marker_numbers(carrier)):
        size = opencv.dictionary_size(dictionary)
        if number >= size:
            raise InputError(
                "marker-number",
                f"carrier {carrier.name!r} shows marker {number}, but {dictionary} has none",
                f"choose numbers from 0 to {size - 1}, or a larger dictionary",
            )


def _check_units(carrier: CarrierKind) -> None:
    """Sizes that no camera of a face rig could use are of another unit."""
    if isinstance(carrier, CharucoPlate | Chessboard):
        key, size, low, high = "square_mm", carrier.square_mm, 1.0, 300.0
    elif isinstance(carrier, AprilGrid):
        key, size, low, high = "tag_mm", carrier.tag_mm, 2.0, 1000.0
    elif isinstance(carrier, DotGrid):
        key, size, low, high = "spacing_mm", carrier.spacing_mm, 1.0, 300.0
    elif isinstance(carrier, MarkerCarrier):
        key, size, low, high = "size_mm", carrier.size_mm, 2.0, 1000.0
    else:
        key, size, low, high = "dot_radius_mm", carrier.dot_radius_mm, 0.3, 60.0
    if not low <= size <= high:
        raise InputError(
            "targets-units",
            f"{key} = {size:g} of carrier {carrier.name!r} cannot be millimetres",
            f"give millimetres, {low:g} to {high:g}",
        )


def _table(row: dict[str, Any]) -> Any:  # noqa: ANN401 - tomlkit's own type
    import tomlkit

    table = tomlkit.table()
    for key, value in row.items():
        if key == "ruler":
            inline = tomlkit.inline_table()
            inline.update(value)
            table[key] = inline
        elif key == "targets":
            lines = tomlkit.array()
            for place in value:
                inline = tomlkit.inline_table()
                inline.update(place)
                lines.append(inline)
            table[key] = lines.multiline(True)
        else:
            table[key] = value
    return table


_FAMILY = ("bits", "code_distance", "mirror_unique", "complement_unique")


def _ruler(model: RulerModel | None) -> Ruler | None:
    return None if model is None else Ruler(**model.model_dump())


def _places(models: list[TargetPlaceModel]) -> tuple[TargetPlace, ...]:
    out = []
    for m in models:
        if m.position_mm is None:
            out.append(TargetPlace(m.number, UNKNOWN_MM))
        else:
            out.append(TargetPlace(m.number, m.position_mm, m.sigma_mm or PLACE_SIGMA_MM))
    return tuple(out)


_TABLES = ("plates", "chessboards", "aprilgrids", "dot_grids", "markers", "rings")


def _with_ruler(
    m: PlateModel | ChessboardModel | AprilGridModel | DotGridModel,
) -> dict[str, Any]:
    return {**m.model_dump(), "ruler": _ruler(m.ruler)}


def _markers(m: MarkersModel) -> MarkerCarrier:
    rest = m.model_dump(exclude={"targets", "ruler"})
    return MarkerCarrier(**rest, places=_places(m.targets), ruler=_ruler(m.ruler))


def _rings(m: RingsModel) -> RingCarrier:
    rest = m.model_dump(exclude={"targets", "ruler", *_FAMILY})
    family = RingCodeFamily(m.bits, m.mirror_unique, m.complement_unique, m.code_distance)
    return RingCarrier(**rest, places=_places(m.targets), ruler=_ruler(m.ruler), family=family)


def _model(carrier: CarrierKind) -> tuple[str, BaseModel]:
    values = vars(carrier).copy()
    ruler = values.pop("ruler")
    values["ruler"] = None if ruler is None else vars(ruler)
    if isinstance(carrier, CharucoPlate):
        return "plates", PlateModel(**values)
    if isinstance(carrier, Board):
        return _board_model(carrier, values)
    values["targets"] = [_place(p) for p in values.pop("places")]
    if isinstance(carrier, MarkerCarrier):
        return "markers", MarkersModel(**values)
    family = values.pop("family")
    values |= {k: getattr(family, k) for k in _FAMILY if k != "code_distance"}
    return "rings", RingsModel(code_distance=family.distance, **values)


def _board_model(board: AnyBoard, values: dict[str, Any]) -> tuple[str, BaseModel]:
    if isinstance(board, Chessboard):
        return "chessboards", ChessboardModel(**values)
    if isinstance(board, AprilGrid):
        return "aprilgrids", AprilGridModel(**values)
    return "dot_grids", DotGridModel(**values)


def _place(place: TargetPlace) -> dict[str, Any]:
    if not all(map(math.isfinite, place.position_mm)):
        return {"number": place.number}
    return {
        "number": place.number,
        "position_mm": place.position_mm,
        "sigma_mm": place.sigma_mm,
    }
