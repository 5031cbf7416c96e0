"""Things to practise with: simulated stations, targets and a bar, with all the files they need."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from string import Template

from calibration.targets.faces import Face, carrier_face
from calibration.targets.files import targets_from

COPIED = ("design.json", "targets.toml", "bar.toml")
STATIONS = {
    "station.toml": (
        "To calibrate and to check: a plate, a stand and a scale bar.",
        ("studio", "things"),
    ),
    "knocked.toml": (
        "The same station after somebody ran into its third camera.",
        ("studio", "things", "knock"),
    ),
    "acceptance.toml": (
        "The same station with a bar of known lengths, for an acceptance test.",
        ("studio", "rod"),
    ),
}


def practice_files() -> dict[str, bytes]:
    """All files by name: three stations, their design, two target sets and the pictures."""
    copied = {name: _text(name) for name in COPIED}
    faces = _faces(copied["targets.toml"]) | _faces(copied["bar.toml"])
    widths = {f"{name}_mm": f"{face.width_mm:.4f}" for name, face in faces.items()}
    stations = {
        name: Template("".join(_text(f"{part}.toml") for part in parts)).substitute(
            widths, words=words
        )
        for name, (words, parts) in STATIONS.items()
    }
    texts = {name: text.encode() for name, text in (copied | stations).items()}
    return texts | {f"{name}.png": face.png for name, face in faces.items()}


def _text(name: str) -> str:
    return files(__name__).joinpath(name).read_text(encoding="utf-8")


def _faces(targets: str) -> dict[str, Face]:
    return {kind.name: carrier_face(kind) for kind in targets_from(targets).carriers}


def write_practice(folder: Path) -> None:
    """Write all files into a folder that exists."""
    for name, data in practice_files().items():
        (folder / name).write_bytes(data)
