"""The tables of a session, made from its records alone: the same records give the same bytes."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rig.acquisition.session.paths import FRAMES_TABLE, SYNC_CHECK, TRIGGER_LOG
from rig.acquisition.session.records import CaptureRecord, FrameEntry

SYNC_SCHEMA = "rigwright.sync/1"
COLUMNS = (
    "capture_id",
    "shot",
    "instant",
    "camera",
    "file",
    "sha256",
    "raw",
    "status",
    "method",
    "counter",
    "device_ns",
    "arrived_host_ns",
    "told_host_ns",
    "told_by",
    "exposed_host_ns",
    "lag_us",
    "lag_uncertainty_us",
    "skew_us",
    "skew_uncertainty_us",
    "exposure_us",
    "gain_db",
    "iso",
    "f_number",
)
TIMING = (
    "name",
    "sync_class",
    "timestamps",
    "lag_us",
    "lag_uncertainty_us",
    "skew_us",
    "skew_uncertainty_us",
    "passed",
)


@dataclass(frozen=True)
class TableRows:
    """What one capture adds to each table."""

    frames: bytes
    trigger: bytes
    sync: bytes


def rows_of(record: CaptureRecord) -> TableRows:
    """The rows and lines of one capture."""
    return TableRows(_frames(record), _trigger(record), _sync(record))


def tables(records: Sequence[CaptureRecord]) -> dict[str, bytes]:
    """All tables by path, of the committed captures in their order."""
    return joined([rows_of(record) for record in records])


def joined(rows: Sequence[TableRows]) -> dict[str, bytes]:
    """All tables by path, of rows that are made already: a long session is not made anew."""
    head = f'{{"schema": "{SYNC_SCHEMA}", "captures": [\n'.encode()
    return {
        FRAMES_TABLE: b"".join([_csv([COLUMNS]), *(one.frames for one in rows)]),
        TRIGGER_LOG: b"".join(one.trigger for one in rows),
        SYNC_CHECK: head + b",\n".join(one.sync for one in rows) + b"\n]}\n",
    }


def _csv(rows: Iterable[Sequence[object]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _frames(record: CaptureRecord) -> bytes:
    """One row per picture; what is not known is empty."""
    settings = {camera.name: camera.settings for camera in record.cameras}
    return _csv(
        _row(record.capture_id, frame, settings.get(frame.camera, {})) for frame in record.frames
    )


def _row(capture_id: str, frame: FrameEntry, settings: dict[str, object]) -> list[object]:
    values = {
        **frame.model_dump(),
        **{key: settings.get(key) for key in ("gain_db", "iso", "f_number")},
        "capture_id": capture_id,
        "file": frame.file.path,
        "sha256": frame.file.sha256,
        "raw": int(frame.raw),
    }
    return [_cell(values[column]) for column in COLUMNS]


def _cell(value: object) -> object:
    if value is None:
        return ""
    return f"{value:.3f}" if isinstance(value, float) else value


def _trigger(record: CaptureRecord) -> bytes:
    """One line per report, edge, line of the wire and clock reading."""
    head = {"capture_id": record.capture_id}
    lines: list[dict[str, object]] = []
    if record.trigger is not None:
        report = record.trigger.model_dump(mode="json", exclude={"edges", "wire"})
        lines.append({**head, "kind": "report", **report})
        edges = (edge.model_dump(mode="json") for edge in record.trigger.edges)
        lines += [{**head, "kind": "edge", **edge} for edge in edges]
        wire = (line.model_dump(mode="json") for line in record.trigger.wire)
        lines += [{**head, "kind": "line", **line} for line in wire]
    keys = ("host_before_ns", "device_ns", "host_after_ns")
    for camera in record.cameras:
        clock = {**head, "kind": "clock", "camera": camera.name}
        lines += [
            {**clock, **dict(zip(keys, sample, strict=True))} for sample in camera.clock_samples
        ]
    return "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines).encode()


def _sync(record: CaptureRecord) -> bytes:
    entry = {
        "capture_id": record.capture_id,
        "verdict": record.verdict.model_dump(mode="json"),
        "cameras": [{key: getattr(camera, key) for key in TIMING} for camera in record.cameras],
        "shots": [shot.model_dump(mode="json") for shot in record.timing],
        "optical": None if record.optical is None else record.optical.model_dump(mode="json"),
    }
    return json.dumps(entry, ensure_ascii=False, allow_nan=False).encode()
