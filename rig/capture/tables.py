"""The tables of a session, made from its records alone: the same records give the same bytes."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence

from rig.capture.jsonfiles import json_bytes
from rig.capture.places import FRAMES_TABLE, SYNC_CHECK, TRIGGER_LOG
from rig.capture.records import CaptureRecord, FrameEntry

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


def tables(records: Sequence[CaptureRecord]) -> dict[str, bytes]:
    """All tables by path, of the committed captures in their order."""
    return {
        FRAMES_TABLE: frames_csv(records),
        TRIGGER_LOG: trigger_jsonl(records),
        SYNC_CHECK: json_bytes(_sync(records)),
    }


def frames_csv(records: Sequence[CaptureRecord]) -> bytes:
    """One row per picture; what is not known is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for record in records:
        settings = {camera.name: camera.settings for camera in record.cameras}
        for frame in record.frames:
            writer.writerow(_row(record.capture_id, frame, settings.get(frame.camera, {})))
    return text.getvalue().encode()


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


def trigger_jsonl(records: Sequence[CaptureRecord]) -> bytes:
    """One line per capture, edge and clock reading."""
    lines = []
    for record in records:
        head = {"capture_id": record.capture_id}
        if record.trigger is not None:
            report = record.trigger.model_dump(mode="json", exclude={"edges"})
            lines.append({**head, "kind": "report", **report})
            lines += [
                {**head, "kind": "edge", **edge.model_dump(mode="json")}
                for edge in record.trigger.edges
            ]
        for camera in record.cameras:
            lines += [
                {
                    **head,
                    "kind": "clock",
                    "camera": camera.name,
                    "host_before_ns": before,
                    "device_ns": device,
                    "host_after_ns": after,
                }
                for before, device, after in camera.clock_samples
            ]
    return "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines).encode()


def _sync(records: Sequence[CaptureRecord]) -> dict[str, object]:
    timing = ("name", "sync_class", "timestamps", "lag_us", "lag_uncertainty_us", "skew_us")
    more = ("skew_uncertainty_us", "passed")
    return {
        "schema": SYNC_SCHEMA,
        "captures": [
            {
                "capture_id": record.capture_id,
                "verdict": record.verdict.model_dump(mode="json"),
                "cameras": [
                    {key: getattr(camera, key) for key in (*timing, *more)}
                    for camera in record.cameras
                ],
                "shots": [shot.model_dump(mode="json") for shot in record.timing],
                "optical": None
                if record.optical is None
                else record.optical.model_dump(mode="json"),
            }
            for record in records
        ],
    }
