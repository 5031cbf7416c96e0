"""What stands in a session's JSON files: pydantic models, nothing else.

``docs/reference/session.schema.json`` and ``docs/reference/capture.schema.json`` are generated
from them. Numbers that are not known are null. Instants of the host's monotonic clock
(``*_host_ns``) compare only within one capture; ``fired_at`` is wall-clock time.
"""

from __future__ import annotations

from collections import Counter
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from common.files.strict import StrictModel


def _inside(path: str) -> str:
    """A path that stays in the session folder, whoever wrote the file it stands in."""
    parts = PurePosixPath(path).parts
    if path.startswith("/") or ".." in parts or "\\" in path:
        raise ValueError("give a path within the session folder")
    return path


Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
RelativePath = Annotated[str, Field(min_length=1, max_length=500), AfterValidator(_inside)]
CaptureId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
Number = float | None


class FileEntry(StrictModel):
    """One file of the session and what it must be."""

    path: RelativePath = Field(description="Path in the session folder.")
    sha256: Sha256 = Field(description="Checksum of its bytes.")
    bytes: int = Field(ge=0, description="Its size.")


class VerdictEntry(StrictModel):
    """Whether a capture was synchronised."""

    state: Literal["synchronised", "not-synchronised", "undecided", "unproven"] = Field(
        description="What can be said."
    )
    level: Literal["none", "A", "B", "C"] = Field(
        description="Highest level of evidence that covers every picture: A edge log, B time "
        "stamps, C timing board."
    )
    within_us: Number = Field(
        description="All exposures' middles of each shot lie within this, uncertainty included."
    )
    limit_us: float = Field(description="The limit it was held against.")
    text: str = Field(description="The same as a sentence.")
    lacking: list[str] = Field(description="What would have to be there for more evidence.")


class FaultEntry(StrictModel):
    """One thing that went wrong."""

    kind: str = Field(description="Its name, as in `docs/explanation/capture.md`.")
    text: str = Field(description="What happened, in a sentence.")
    camera: str | None = Field(description="Whose picture; null: nobody's.")
    shot: int | None = Field(description="Which shot, from 1; null: none in particular.")


class FrameEntry(StrictModel):
    """One picture (or raw file) of a capture."""

    camera: str = Field(description="Name of the camera.")
    shot: int = Field(ge=1, description="Shot of this capture, from 1.")
    instant: int = Field(ge=1, description="Number of the instant in the session: the file name.")
    raw: bool = Field(description="Whether it is a raw file beside the picture.")
    file: FileEntry = Field(description="Where it is filed.")
    media_type: str = Field(description="What kind of file it is.")
    status: str = Field(description="How it arrived: `ok`, `incomplete`, `late`.")
    method: str = Field(
        description="How it was given to its shot: `timestamp`, `file-time`, `arrival-order`."
    )
    counter: int | None = Field(description="The camera's frame counter.")
    device_ns: int | None = Field(description="The camera's own time stamp.")
    arrived_host_ns: int = Field(description="When it arrived.")
    told_host_ns: int | None = Field(description="When the camera was told to expose.")
    told_by: str = Field(
        description="How that is known: `edge-log`, `programmed`, `command`, `none`."
    )
    exposed_host_ns: int | None = Field(description="Start of its exposure.")
    lag_us: Number = Field(description="From told to exposed.")
    lag_uncertainty_us: Number = Field(description="Half width within which the lag is known.")
    skew_us: Number = Field(description="From the median of all cameras' middles to its middle.")
    skew_uncertainty_us: Number = Field(description="Half width within which it is known.")
    exposure_us: Number = Field(description="Its exposure time.")
    metadata: dict[str, str] = Field(description="What else the camera said.")


class UnfiledEntry(StrictModel):
    """A file that came during a capture and was not filed: what it tells is learned from."""

    camera: str = Field(description="Name of the camera it came for.")
    media_type: str = Field(description="What kind of file it is.")
    metadata: dict[str, str] = Field(description="Its name, its checksum, what it says.")


class CameraEntry(StrictModel):
    """One camera of a capture: what it was, what it was set to, how it timed."""

    name: str = Field(description="Name of the camera.")
    backend: str = Field(description="How it was reached.")
    id: str = Field(description="Its serial number.")
    vendor: str = Field(description="Who made it.")
    model: str = Field(description="What it is.")
    trigger: str = Field(description="What made it expose: `edge`, `software`, `none`.")
    timestamps: str = Field(description="Which clock stamps its frames.")
    sync_class: str = Field(description="`hardware`, `ptp`, `software` or `none`.")
    output: int | None = Field(description="Output of the box that fired it.")
    delay_us: float = Field(description="From the shot's zero to its edge.")
    settings: dict[str, Any] = Field(description="What it really was set to; null: unknown.")
    lag_us: Number = Field(description="Median lag over the shots.")
    lag_uncertainty_us: Number = Field(description="Half width within which it is known.")
    skew_us: Number = Field(description="Skew in its worst shot.")
    skew_uncertainty_us: Number = Field(description="Half width within which it is known.")
    passed: Literal["pass", "fail", "undecided"] | None = Field(
        description="The skew against the limit; null: unknown."
    )
    clock_samples: list[list[int]] = Field(
        description="Readings of its clock: host before, device, host after, in ns."
    )


class EdgeEntry(StrictModel):
    """One edge of the box's log."""

    shot: int = Field(description="Shot, from 1.")
    output: int = Field(description="Output of the box.")
    rising: bool = Field(description="Whether it rose.")
    at_us: float = Field(description="From the shot's start.")
    at_host_ns: int = Field(description="On the host's clock.")
    late_us: float = Field(description="Later than programmed by this.")


class WireEntry(StrictModel):
    """One line that host and box said to each other."""

    host_ns: int = Field(description="When, on the host's clock.")
    sent: bool = Field(description="Whether the host said it.")
    text: str = Field(description="The line as it stood.")


class TriggerEntry(StrictModel):
    """What the box says: level A of the evidence."""

    box_capture: str = Field(description="The capture's name at the box.")
    outcome: str = Field(description="`fired`, `partial`, `not-fired`, `unknown`.")
    acknowledged: bool = Field(description="Whether the box said so in answer to FIRE.")
    why: str = Field(description="How the outcome was found, where it was not plainly said.")
    shots_done: int = Field(description="Shots made.")
    shots_wanted: int = Field(description="Shots asked for.")
    clock_uncertainty_us: Number = Field(description="How well its clock is known on the host's.")
    error_us: Number = Field(description="Largest difference of an edge to what was programmed.")
    edges: list[EdgeEntry] = Field(description="Its log; empty for a box without one.")
    wire: list[WireEntry] = Field(description="Every line from ARM to the last answer.")


class ShotEntry(StrictModel):
    """One shot over all cameras: level B of the evidence."""

    shot: int = Field(description="Shot, from 1.")
    cameras: int = Field(description="Cameras whose exposures are known.")
    spread_us: Number = Field(description="From the first to the last exposure's middle.")
    spread_uncertainty_us: Number = Field(description="Half width within which it is known.")
    overlap_us: Number = Field(
        description="For how long all shutters were open at once; negative: never."
    )
    middles: bool = Field(description="Whether middles were compared; else starts.")


class ReadingEntry(StrictModel):
    """One picture's reading of the timing board: level C of the evidence."""

    camera: str = Field(description="Name of the camera.")
    shot: int = Field(description="Shot, from 1.")
    mid_us: float = Field(description="Middle of the exposure, from the board's start.")
    uncertainty_us: float = Field(description="Half width within which it is known.")
    exposure_us: float = Field(description="Length of the exposure.")
    lag_us: Number = Field(description="From the camera's edge to the start of its exposure.")
    lag_uncertainty_us: Number = Field(description="Half width within which it is known.")


class OpticalEntry(StrictModel):
    """All readings of the timing board."""

    readings: list[ReadingEntry] = Field(description="Picture by picture.")
    unread: dict[str, str] = Field(description="Cameras that could not read it, and why.")
    spread_us: Number = Field(description="Of the middles, in the worst shot.")
    spread_uncertainty_us: Number = Field(description="Half width within which it is known.")


class CaptureRecord(StrictModel):
    """The root of a capture's file, `captures/<number>-<id>.json`."""

    schema_: Literal["rigwright.capture/1"] = Field(
        alias="schema", description="Version of the format."
    )
    capture_id: CaptureId = Field(description="The id the client chose.")
    number: int = Field(ge=1, description="Number of the capture in the session.")
    fired_at: str = Field(description="Wall-clock time of the first shot, ISO 8601 with offset.")
    shots: int = Field(ge=1, description="Shots asked for.")
    interval_us: float = Field(description="From shot to shot.")
    first_instant: int = Field(ge=1, description="Number of its first shot's instant.")
    state: Literal["complete", "partial"] = Field(
        description="`complete`: a sound picture of every shot by every camera."
    )
    partial_allowed: bool = Field(description="Whether less than complete was allowed.")
    missing: dict[str, list[int]] = Field(description="Shots without a picture, by camera.")
    verdict: VerdictEntry = Field(description="Whether it was synchronised.")
    faults: list[FaultEntry] = Field(description="Everything that went wrong.")
    cameras: list[CameraEntry] = Field(description="The cameras that took part.")
    frames: list[FrameEntry] = Field(description="The pictures.")
    unfiled: list[UnfiledEntry] = Field(
        default_factory=list,
        description="Files that came for cameras seen only through files, and were not filed.",
    )
    trigger: TriggerEntry | None = Field(description="The box's part; null: there was none.")
    timing: list[ShotEntry] = Field(description="The shots in time.")
    optical: OpticalEntry | None = Field(description="The timing board; null: not looked for.")


def contradictions(record: CaptureRecord) -> list[str]:
    """What a record says against itself, a sentence each; none may be written that does.

    Records written before this was looked at can be read, and are found by ``verify_session``.
    """
    have = {(frame.camera, frame.shot) for frame in record.frames}
    names = {camera.name for camera in record.cameras}
    lost = {(name, shot) for name, shots in record.missing.items() for shot in shots}
    wanted = {(name, shot) for name in names for shot in range(1, record.shots + 1)}
    found = []
    if record.state == "complete" and lost:
        found.append(f"it is complete and lacks a picture of {min(lost)[0]}")
    found += [f"a picture of {name} is filed and missing" for name, _ in sorted(have & lost)]
    found += [
        f"{name} has no picture of shot {shot}, and nothing says so"
        for name, shot in sorted(wanted - have - lost)
    ]
    found += [f"a picture of {name} is of no camera or shot" for name, _ in sorted(have - wanted)]
    files = Counter(frame.file.path for frame in record.frames)
    found += [f"{path} is {n} pictures at once" for path, n in sorted(files.items()) if n > 1]
    return found


class CaptureEntry(StrictModel):
    """A committed capture as the session lists it."""

    capture_id: CaptureId = Field(description="The id the client chose.")
    number: int = Field(ge=1, description="Number of the capture in the session.")
    state: Literal["complete", "partial"] = Field(description="As in its record.")
    fired_at: str = Field(description="Wall-clock time of the first shot.")
    first_instant: int = Field(ge=1, description="Number of its first shot's instant.")
    shots: int = Field(ge=1, description="Shots asked for.")
    pictures: int = Field(ge=0, description="Pictures that are there.")
    verdict: VerdictEntry = Field(description="Whether it was synchronised.")
    record: FileEntry = Field(description="Its own file.")


class InterruptedEntry(StrictModel):
    """A capture that was begun and not committed. Its id is not used again."""

    capture_id: CaptureId = Field(description="The id the client chose.")
    fate: Literal["unknown", "fired"] = Field(
        description="Whether the box fired: `unknown` when nobody can tell."
    )
    why: str = Field(description="What interrupted it.")
    at: str = Field(description="When that was found out, ISO 8601.")
    folder: RelativePath = Field(description="Where what is left of it was put, if anything is.")


class SessionFile(StrictModel):
    """The root of `session.json`."""

    schema_: Literal["rigwright.session/1"] = Field(
        alias="schema", description="Version of the format."
    )
    rigwright: str = Field(description="Version of the program that began it.")
    session_id: str = Field(pattern=r"^[0-9a-f]{32}$", description="Names the session for good.")
    subject: str = Field(max_length=200, description="Who or what is photographed.")
    operator: str = Field(max_length=200, description="Who photographs.")
    created_at: str = Field(description="When it was begun, ISO 8601 with offset.")
    station: str = Field(description="Name of the station.")
    rig_sha256: Sha256 = Field(
        description="Checksum of what makes the rig: camera names, devices, design."
    )
    rig: list[FileEntry] = Field(description="The files in `rig/`.")
    captures: list[CaptureEntry] = Field(description="The committed captures.")
    tables: list[FileEntry] = Field(
        description="`frames.csv`, `trigger.jsonl` and `checks/sync.json`, made from the records."
    )
    interrupted: list[InterruptedEntry] = Field(description="Captures that were not committed.")
    digest: str = Field(
        pattern=r"^([0-9a-f]{64})?$",
        description="Checksum of this file's content without this key.",
    )
