"""A gallery as one file: a NumPy archive with a JSON document, and no code in it."""

from __future__ import annotations

import io
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from common.errors import InputError, NotFoundError
from common.files.strict import StrictModel, parsed
from common.files.writing import write_whole
from evaluation.recognition.classifier import RegionClassifier
from evaluation.recognition.gallery import MOST_PERSONS, Gallery, Trained
from evaluation.recognition.recogniser import Rates, Recogniser, Template
from evaluation.recognition.regions import REGIONS

SCHEMA = "rigwright.gallery/1"
LARGEST_BYTES = 500_000_000
_DOCUMENT = "document"
_PARTS = ("mean_mm", "basis", "spread_mm", "project", "between")
_REMEDY = "give a file that `rigwright recognise` wrote"
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=0)]


class _Rates(StrictModel):
    threshold: Share
    false_match: Share
    false_non_match: Share
    equal_error: Share
    impostors: Count
    genuines: Count


class _Trained(StrictModel):
    persons: Count
    captures: Count
    population: Annotated[str, Field(max_length=500)]


class _Document(StrictModel):
    schema_: Annotated[Literal["rigwright.gallery/1"], Field(alias="schema")]
    regions: list[str]
    rates: _Rates
    trained: _Trained
    persons: Annotated[list[str], Field(max_length=MOST_PERSONS)]


def gallery_bytes(gallery: Gallery) -> bytes:
    """The file's bytes."""
    recogniser, names = gallery.recogniser, list(gallery.persons)
    rates, trained = recogniser.rates, gallery.trained
    document = _Document.model_validate(
        {
            "schema": SCHEMA,
            "regions": [r.name for r in REGIONS],
            "rates": asdict(rates),
            "trained": asdict(trained),
            "persons": names,
        }
    )
    text = document.model_dump_json(by_alias=True).encode()
    arrays: dict[str, NDArray[np.generic]] = {
        _DOCUMENT: np.frombuffer(text, dtype=np.uint8),
        "thresholds": np.asarray(recogniser.thresholds),
    }
    for k, classifier in enumerate(recogniser.classifiers):
        for part in _PARTS:
            arrays[f"{k:02d}-{part}"] = np.asarray(getattr(classifier, part), dtype=np.float32)
    templates = [gallery.persons[name] for name in names]
    size = sum(len(c.between) for c in recogniser.classifiers)
    values = [t.values for t in templates] or [np.zeros((0, size))]
    captures = [t.captures for t in templates] or [np.zeros((0, len(REGIONS)), dtype=np.int64)]
    arrays["values"] = np.vstack(values).astype(np.float32)
    arrays["captures"] = np.vstack(captures).astype(np.int32)
    stream = io.BytesIO()
    np.savez_compressed(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def write_gallery(path: Path, gallery: Gallery, *, overwrite: bool = False) -> None:
    """Writes the gallery whole or not at all, for its owner's eyes: faces are personal data."""
    write_whole(path, gallery_bytes(gallery), overwrite=overwrite, private=True)


def read_gallery(path: Path) -> Gallery:
    """The gallery in a file. Raises :class:`InputError` in one line for what is none."""
    if not path.is_file():
        what = f"{path} is a folder" if path.exists() else f"there is no file {path}"
        raise NotFoundError("gallery", what, "check the path, or enrol somebody with --model")
    arrays = _arrays(path)
    text = arrays[_DOCUMENT].astype(np.uint8).tobytes()
    document = parsed(_Document, text, path.name)
    if document.regions != [r.name for r in REGIONS]:
        raise InputError(
            "gallery-regions", f"{path.name} has other regions than this program", "train it again"
        )
    try:
        return _gallery(document, arrays)
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise _damaged(path) from error


def _damaged(path: Path) -> InputError:
    return InputError("gallery-file", f"{path.name} is no gallery, or is damaged", _REMEDY)


def _arrays(path: Path) -> dict[str, NDArray[np.float64]]:
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = [entry.file_size for entry in archive.infolist()]
            wanted = {f"{n}.npy" for n in _names()}
            if {e.filename for e in archive.infolist()} != wanted or len(sizes) != len(wanted):
                raise _damaged(path)
        if sum(sizes) > LARGEST_BYTES:
            problem = f"{path.name} unpacks to more than {LARGEST_BYTES // 1_000_000} MB"
            raise InputError("gallery-large", problem, _REMEDY)
        with np.load(path, allow_pickle=False) as archive:
            found = {name: np.asarray(archive[name]) for name in _names()}
    except (zipfile.BadZipFile, ValueError, OSError, EOFError, KeyError) as error:
        raise _damaged(path) from error
    if any(a.dtype.kind not in "fiu" for a in found.values()):
        raise _damaged(path)
    return {name: array.astype(np.float64) for name, array in found.items()}


def _names() -> list[str]:
    parts = [f"{k:02d}-{part}" for k in range(len(REGIONS)) for part in _PARTS]
    return [_DOCUMENT, "thresholds", "values", "captures", *parts]


def _gallery(document: _Document, arrays: dict[str, NDArray[np.float64]]) -> Gallery:
    classifiers = tuple(
        RegionClassifier(*(arrays[f"{k:02d}-{part}"] for part in _PARTS))
        for k in range(len(REGIONS))
    )
    rates = Rates(**document.rates.model_dump())
    recogniser = Recogniser(classifiers, arrays["thresholds"], rates)
    values, captures = arrays["values"], arrays["captures"].astype(np.int64)
    size, count = sum(len(c.between) for c in classifiers), len(document.persons)
    if values.shape != (count, size) or captures.shape != (count, len(REGIONS)):
        raise ValueError("templates and names differ in number")
    if len(set(document.persons)) != count or (count and captures.min() < 0):
        raise ValueError("a person stands twice")
    persons = {name: Template(values[k], captures[k]) for k, name in enumerate(document.persons)}
    return Gallery(recogniser, Trained(**document.trained.model_dump()), persons)
