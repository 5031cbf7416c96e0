"""Galleries as files: what is written is read, and nothing else is."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from recognition_faces import fields, small_gallery

from common.errors import InputError, NotFoundError
from evaluation.recognition import galleryfile
from evaluation.recognition.gallery import Gallery
from evaluation.recognition.galleryfile import gallery_bytes, read_gallery, write_gallery


@pytest.fixture(scope="module")
def filled() -> Gallery:
    images, _ = fields(2, 2, 0.1, seed=7)
    gallery = small_gallery().enrolled("anna", images[0]).enrolled("anna", images[1])
    return gallery.enrolled("Bea 2", images[2])


def test_what_is_written_is_read(filled: Gallery, tmp_path: Path) -> None:
    write_gallery(tmp_path / "g.npz", filled)
    again = read_gallery(tmp_path / "g.npz")
    assert again.recogniser.rates == filled.recogniser.rates
    assert again.trained == filled.trained
    assert list(again.persons) == ["anna", "Bea 2"]
    images, _ = fields(2, 2, 0.1, seed=7)
    for name in again.persons:
        assert (again.persons[name].captures == filled.persons[name].captures).all()
        before, after = (g.verify(name, images[3]) for g in (filled, again))
        # Single precision may tip the vote of one region in thirty.
        assert after.score == pytest.approx(before.score, abs=1.5 / 30)
    assert (tmp_path / "g.npz").stat().st_mode & 0o077 == 0


def test_two_captures_are_averaged(filled: Gallery) -> None:
    assert set(filled.persons["anna"].captures) == {2}
    images, _ = fields(2, 2, 0.1, seed=7)
    one, two = (filled.recogniser.template(i) for i in images[:2])
    np.testing.assert_allclose(filled.persons["anna"].values, (one.values + two.values) / 2)


def test_persons_are_told_apart_and_strangers_named(filled: Gallery) -> None:
    images, _ = fields(2, 2, 0.1, seed=7)
    assert filled.verify("Bea 2", images[3]).same
    assert not filled.verify("anna", images[3]).same
    with pytest.raises(NotFoundError, match="carl is not in the gallery, which has Bea 2, anna"):
        filled.verify("carl", images[3])
    with pytest.raises(InputError, match="no name for a person"):
        filled.enrolled("../anna", images[0])


def test_a_face_with_too_many_holes_is_refused(filled: Gallery) -> None:
    images, _ = fields(1, 1, 0.1)
    holes = images[0].copy()
    holes[:, 40:] = np.nan
    with pytest.raises(InputError, match="regions of the face were measured"):
        filled.verify("anna", holes)
    half = images[0].copy()
    half[:60] = np.nan
    found = filled.recogniser.template(half)
    assert 15 <= (found.captures > 0).sum() < 30


def changed(data: bytes, name: str, content: bytes | None) -> bytes:
    """The archive with one entry replaced, added, or (None) left out."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        for entry in old.namelist():
            if entry != name:
                new.writestr(entry, old.read(entry))
        if content is not None:
            new.writestr(name, content)
    return out.getvalue()


def npy(array: object, *, allow_pickle: bool = False) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=allow_pickle)
    return stream.getvalue()


def document(data: bytes, **keys: object) -> bytes:
    """The archive with keys of its document set."""
    with np.load(io.BytesIO(data)) as archive:
        text = json.loads(archive["document"].tobytes())
    return changed(
        data, "document.npy", npy(np.frombuffer(json.dumps(text | keys).encode(), np.uint8))
    )


def test_what_is_no_gallery_is_one_line(filled: Gallery, tmp_path: Path) -> None:
    data = gallery_bytes(filled)
    pickled = npy(np.array([{"a": 1}], dtype=object), allow_pickle=True)
    cases = {
        "text": (b"solid head", "is no gallery, or is damaged"),
        "cut": (data[: len(data) // 2], "is no gallery, or is damaged"),
        "pickle": (changed(data, "values.npy", pickled), "is no gallery, or is damaged"),
        "missing": (changed(data, "03-basis.npy", None), "is no gallery, or is damaged"),
        "more": (changed(data, "more.npy", npy([1.0])), "is no gallery, or is damaged"),
        "shape": (changed(data, "03-basis.npy", npy(np.eye(3))), "do not fit together"),
        "persons": (document(data, persons=["anna"]), "is no gallery, or is damaged"),
        "twice": (document(data, persons=["anna", "anna"]), "is no gallery, or is damaged"),
        "key": (document(data, shape=1), "shape is not known"),
        "schema": (document(data, schema="rigwright.gallery/9"), "schema"),
        "regions": (document(data, regions=["nose"]), "other regions than this program"),
        "nan": (changed(data, "values.npy", npy(np.full((2, 5), np.nan))), "is no gallery"),
    }
    for name, (content, words) in cases.items():
        path = tmp_path / f"{name}.npz"
        path.write_bytes(content)
        with pytest.raises(InputError, match=words):
            read_gallery(path)
    with pytest.raises(NotFoundError, match="there is no file"):
        read_gallery(tmp_path / "none.npz")


def test_an_archive_that_unpacks_too_large_is_refused(
    filled: Gallery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_gallery(tmp_path / "g.npz", filled)
    monkeypatch.setattr(galleryfile, "LARGEST_BYTES", 100_000)
    with pytest.raises(InputError, match="unpacks to more than"):
        read_gallery(tmp_path / "g.npz")


def test_against_nobody_there_is_nothing_to_score(filled: Gallery) -> None:
    templates = list(filled.persons.values())
    assert filled.recogniser.scores(templates, []).shape == (2, 0)
    assert filled.recogniser.scores([], templates).shape == (0, 2)
