"""Where the pictures of a command are, and what it measures against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from common.errors import InputError
from service.cli.running import processes
from service.kinds.base import RunContext

TARGETS = "targets.toml"
CALIBRATION = "calibration.json"


@dataclass(frozen=True)
class PictureSource:
    """Pictures as a task takes them: named by its run, or an archive among its inputs."""

    run: RunContext
    given: Path
    inputs: Mapping[str, Path] = field(default_factory=dict)


def picture_source(
    pictures: Path, captures: Sequence[str] | None, workers: int | None
) -> PictureSource:
    """A session, a folder with a folder per camera, or an archive of one.

    Raises :class:`InputError` for captures of what is no session.
    """
    run = RunContext(
        workers=processes(workers), made_utc=datetime.now(UTC).isoformat(timespec="seconds")
    )
    if (pictures / "session.json").is_file():
        named = {"session": str(pictures.resolve()), "captures": list(captures or ())}
        return PictureSource(run.model_copy(update=named), pictures)
    if captures:
        raise InputError(
            "no-session", f"{pictures} is no session, so it has no captures", "leave --capture out"
        )
    if pictures.is_dir():
        folder = {"pictures": str(pictures.resolve())}
        return PictureSource(run.model_copy(update=folder), pictures)
    return PictureSource(run, pictures, {"pictures": pictures})


def reference_file(given: Path) -> Path:
    """The file of a calibration that is given as a file or as its folder."""
    if not given.is_dir():
        return given
    if not (given / CALIBRATION).is_file():
        raise InputError(
            "no-calibration",
            f"the folder {given} holds no {CALIBRATION}",
            "give a folder that rigwright calibrate wrote",
        )
    return given / CALIBRATION
