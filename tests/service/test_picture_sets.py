"""Pictures in folders, archives and uploads: which camera, which frame, and what is refused."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from service_helpers import InThisProcess, TestClient, files_under

from common.errors import InputError, RigwrightError, TooLargeError
from service.api.context import Service
from service.jobs.process import ProcessEngine
from service.pictures import archive
from service.pictures.archive import archive_facts, unpack
from service.pictures.listing import pictures_in_folder

PIXEL = b"P5 1 1 255\n\x00"


@pytest.fixture
def engine() -> InThisProcess:
    """What an archive holds is asked about here: a process for each takes half a second."""
    return InThisProcess()


def packed(*names: str, content: bytes = PIXEL, method: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name in names:
            archive.writestr(name, content)
    return out.getvalue()


def test_a_folder_per_camera(tmp_path: Path) -> None:
    for name in (
        "cam02/0001.png",
        "cam01/0002.jpg",
        "cam01/0001.png",
        "cam01/.0003.png",
        "x/a.txt",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(PIXEL)
    found = pictures_in_folder(tmp_path)
    assert [(p.camera, p.frame) for p in found] == [
        ("cam01", "0001"),
        ("cam01", "0002"),
        ("cam02", "0001"),
    ]


def test_what_a_folder_may_lack(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no folder"):
        pictures_in_folder(tmp_path / "none")
    with pytest.raises(InputError, match=r"holds no pictures; put each camera's pictures"):
        pictures_in_folder(tmp_path)
    (tmp_path / "0001.png").write_bytes(PIXEL)
    with pytest.raises(InputError, match=r"pictures but no folders of cameras"):
        pictures_in_folder(tmp_path)
    (tmp_path / "a").mkdir()
    for name in ("1.png", "1.jpg"):
        (tmp_path / "a" / name).write_bytes(PIXEL)
    with pytest.raises(InputError, match=r"the same frame twice"):
        pictures_in_folder(tmp_path)


def test_an_archive_may_have_a_folder_around_all(tmp_path: Path) -> None:
    (tmp_path / "p.zip").write_bytes(
        packed("all/cam01/1.png", "all/cam02/1.png", "all/notes.txt", "__MACOSX/cam01/1.png")
    )
    facts = archive_facts(tmp_path / "p.zip")
    assert facts.cameras == {"cam01": 1, "cam02": 1}
    assert (facts.frames, facts.bytes) == (1, 2 * len(PIXEL))
    (tmp_path / "out").mkdir()
    unpack(tmp_path / "p.zip", tmp_path / "out")
    assert [p.path.read_bytes() for p in pictures_in_folder(tmp_path / "out")] == [PIXEL, PIXEL]


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"no zip", "input/pictures-archive"),
        (packed("1.png"), "input/pictures-none"),
        (packed("readme.txt"), "input/pictures-none"),
        (packed("a/1.png", "b/a/1.png"), "input/pictures-twice"),
        (packed("a/\x1b[31m.png"), "input/pictures-archive"),
        (packed("cam01\n/1.png"), "input/pictures-archive"),
        (packed("../1.png"), "input/pictures-none"),
        (packed("a/1.png")[:-30], "input/pictures-archive"),
        (
            packed("a/1.bmp", content=bytes(1 << 24), method=zipfile.ZIP_DEFLATED),
            "too-large/pictures",
        ),
    ],
    # An archive carries the time it was made: as part of a test's name it differs by worker.
    ids=["no-zip", "loose", "text", "twice", "name", "newline", "outside", "cut", "bomb"],
)
def test_archives_that_are_refused(
    client: TestClient, service: Service, content: bytes, code: str
) -> None:
    answer = client.post("/v1/picture-sets?filename=p.zip", content=content)
    assert answer.json()["type"] == f"/problems/{code}", answer.text
    assert answer.status_code in (413, 422)
    folder = service.store.folder
    assert not any(files_under(folder / name) for name in ("blobs", "tmp", "work"))


def broken(path: Path, method: int) -> None:
    """An archive whose list is sound and whose picture is not."""
    content = bytearray(packed("a/1.png", content=bytes(range(256)) * 40, method=method))
    content[40:60] = bytes(20)
    path.write_bytes(content)


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_a_picture_that_cannot_be_unpacked_is_one_line(tmp_path: Path, method: int) -> None:
    broken(tmp_path / "p.zip", method)
    assert archive_facts(tmp_path / "p.zip").frames == 1
    with pytest.raises(InputError, match=r"p\.zip is no sound ZIP archive"):
        unpack(tmp_path / "p.zip", tmp_path)


def test_a_way_of_packing_that_is_not_known_is_one_line(tmp_path: Path) -> None:
    content = bytearray(packed("a/1.png"))
    for header, at in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        place = content.index(header) + at
        content[place : place + 2] = (98).to_bytes(2, "little")  # PPMd
    (tmp_path / "p.zip").write_bytes(content)
    with pytest.raises(InputError, match=r"p\.zip is no sound ZIP archive"):
        unpack(tmp_path / "p.zip", tmp_path)


def test_what_would_fill_the_disk_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "p.zip").write_bytes(packed("a/1.png"))
    monkeypatch.setattr(archive, "KEPT_FREE", 1 << 60)
    with pytest.raises(TooLargeError, match="GB are free; make room"):
        unpack(tmp_path / "p.zip", tmp_path)
    assert not (tmp_path / "a").exists()


NAMES = st.characters(exclude_characters="\x00", exclude_categories=["Cs"])
"""zipfile itself cuts names off at a zero."""


@settings(max_examples=30, deadline=None)
@given(names=st.lists(st.text(NAMES, max_size=30), max_size=4), cut=st.integers(0, 400))
def test_no_archive_writes_outside_its_folder(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], cut: int
) -> None:
    folder = tmp_path_factory.mktemp("unpack")
    path, out = folder / "p.zip", folder / "in" / "out"
    out.mkdir(parents=True)
    content = packed(*(name + ".png" for name in dict.fromkeys(names)))
    path.write_bytes(content[: max(len(content) - cut, 0)] if cut < 50 else content)
    try:
        unpack(path, out)
    except RigwrightError as error:
        assert isinstance(error, InputError | TooLargeError)
        assert "\n" not in str(error)
    outside = [p for p in files_under(folder) if p != path and out not in p.parents]
    assert outside == []


@pytest.mark.parametrize("engine", [ProcessEngine()], ids=["a process"])
def test_a_picture_set_over_http(client: TestClient, service: Service) -> None:
    content = packed("cam01/1.png", "cam01/2.png", "cam02/1.png")
    answer = client.post("/v1/picture-sets?filename=../my%20set.zip", content=content)
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert made["cameras"] == {"cam01": 2, "cam02": 1}
    assert made["frames"] == 2
    assert client.get(answer.headers["Location"]).json() == made
    again = client.post("/v1/picture-sets", content=content)
    assert (again.status_code, again.json()) == (200, made)
    assert client.get("/v1/picture-sets").json() == {"items": [made], "next": None}
    assert client.delete(made["links"]["self"]).status_code == 204
    assert client.get(made["links"]["self"]).json()["type"] == "/problems/not-found/picture-set"
    assert files_under(service.store.folder / "blobs") == []


def test_a_form_is_not_an_archive(client: TestClient) -> None:
    answer = client.post("/v1/picture-sets", files={"file": b"x"})
    assert answer.json()["type"] == "/problems/input/media-type"
