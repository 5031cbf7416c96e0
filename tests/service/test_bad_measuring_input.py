"""Bad pictures, target files and references through both doors: one line, and nothing left."""

from __future__ import annotations

import io
import shutil
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from held_targets import FACING, PLATE, PLATE_TOML, Pictures, held, rig, shown, write_pictures
from service_helpers import InThisProcess, files_under, one_line_and_nothing_left, wait_for
from starlette.testclient import TestClient

from rig.session.folder import Session, SessionPlan
from service.api.app import create_app
from service.api.context import Service
from service.kinds import KINDS
from service.settings import read_settings

JSON = dict[str, Any]
Make = Callable[[Path, Pictures], object]
CAMERAS = rig()[:3]


@dataclass(frozen=True)
class Case:
    """What is put into ``pictures``, the target file, and words of what is said of them."""

    words: str
    make: Make
    targets: str = PLATE_TOML
    quick: bool = False
    """Whether the command line is tried among the quick tests, too: it takes two seconds."""


def each(change: Callable[[np.ndarray], np.ndarray], *cameras: str, suffix: str = ".png") -> Make:
    """Pictures changed, of all cameras or of some."""

    def make(folder: Path, pictures: Pictures) -> object:
        changed = {
            camera: {
                frame: change(picture) if camera in cameras or not cameras else picture
                for frame, picture in frames.items()
            }
            for camera, frames in pictures.items()
        }
        return write_pictures(folder, changed, suffix)

    return make


def one(change: Callable[[Path], object], suffix: str = ".png") -> Make:
    """One file of the second camera changed."""

    def make(folder: Path, pictures: Pictures) -> object:
        write_pictures(folder, pictures, suffix)
        return change(folder / "cam02" / f"01{suffix}")

    return make


def halved(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def smaller(path: Path) -> None:
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert cv2.imwrite(str(path), cv2.resize(picture, (320, 240)))


def one_camera(folder: Path, pictures: Pictures) -> object:
    return write_pictures(folder, {"cam01": pictures["cam01"]})


def straight_on(folder: Path, _pictures: Pictures) -> object:
    """A plate that is always held the same way tells distance and focal length together only."""
    return write_pictures(folder, shown(PLATE, CAMERAS, [(FACING, np.zeros(3))]))


def mirrored(picture: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(picture[:, ::-1])


def with_alpha(alpha: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda v: np.dstack([v, v, v, np.full_like(v, alpha)])


same = each(lambda picture: picture)

CASES: dict[str, Case] = {
    "no targets": Case("shows no target", each(lambda v: np.full_like(v, 120)), quick=True),
    "one camera only": Case("1 camera only", one_camera),
    "all mirrored": Case("camera cam01: the picture is mirrored", each(mirrored)),
    "one mirrored": Case("camera cam02: the picture is mirrored", each(mirrored, "cam02")),
    "one upside down in a mirror": Case(
        "camera cam03: the picture is mirrored", each(lambda v: v[::-1], "cam03")
    ),
    "mixed sizes": Case("01.png has 320 x 240 pixels", one(smaller)),
    "columns and rows exchanged": Case(
        "exchange columns and rows",
        same,
        PLATE_TOML.replace("columns = 6", "columns = 5").replace("rows = 5", "rows = 6"),
    ),
    "another board": Case(
        "has 6 columns, not 7", same, PLATE_TOML.replace("columns = 6", "columns = 7")
    ),
    "another dictionary": Case(
        "markers of DICT_4X4_50, none of DICT_5X5_50", same, PLATE_TOML.replace("4X4", "5X5")
    ),
    "no such dictionary": Case("DICT_4X4_50", same, PLATE_TOML.replace("4X4_50", "4X4_51")),
    "metres": Case(
        "give millimetres", same, PLATE_TOML.replace("25.0", "0.025").replace("18.0", "0.018")
    ),
    "a broken JPEG": Case("cam02/01.jpg is a broken JPEG", one(halved, ".jpg"), quick=True),
    "a broken PNG": Case("cam02/01.png is not a picture", one(halved)),
    "a text": Case("cam02/01.png is not a picture", one(lambda p: p.write_text("hello"))),
    "transparent": Case(
        "a fourth channel that is not opaque", each(with_alpha(200), "cam02"), quick=True
    ),
    "fractions": Case(
        "pixels of type float32", each(lambda v: v.astype(np.float32) / 255.0, suffix=".tif")
    ),
    "tiny": Case("cam01/00.png has the shape (8, 8)", each(lambda v: v[:8, :8])),
    "always the same view": Case("tilt the plate", straight_on),
    "a misspelt key": Case(
        "did you mean square_mm", same, PLATE_TOML.replace("square_mm", "sqare_mm")
    ),
    "no carriers": Case("has no targets", same, 'schema = "rigwright.targets/1"\nname = "x"\n'),
    "no TOML": Case("is not TOML", same, PLATE_TOML.replace("[[plates]]", "[[plates]")),
    "an empty folder": Case("holds no pictures", lambda folder, _: folder.mkdir()),
    "no folders of cameras": Case(
        "no folders of cameras",
        lambda folder, pictures: shutil.move(write_pictures(folder, pictures) / "cam01", folder / "x")
        and [p.rename(folder / p.name) for p in (folder / "x").iterdir()]
        and [shutil.rmtree(folder / name) for name in ("x", "cam02", "cam03")],
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def pictures() -> Pictures:
    """A plate in four places, as three cameras see it."""
    return shown(PLATE, CAMERAS, held(4, 3))


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    settings = read_settings(
        data_dir=folder / "data", sessions_dir=folder / "sessions", workers_per_job=1
    )
    opened = Service(settings, KINDS, InThisProcess())
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def client(service: Service) -> Iterator[TestClient]:
    with TestClient(create_app(service)) as opened:
        yield opened


def put(folder: Path, case: Case, pictures: Pictures) -> Path:
    folder.mkdir()
    case.make(folder / "pictures", pictures)
    (folder / "set.toml").write_text(case.targets)
    return folder


def packed(folder: Path) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for path in files_under(folder):
            archive.write(path, path.relative_to(folder))
    return out.getvalue()


def ended(client: TestClient, answer: Any) -> JSON:  # noqa: ANN401 - the client's own type
    assert answer.status_code == 201, answer.text

    def look() -> JSON | None:
        job: JSON = client.get(answer.headers["Location"]).json()
        return job if job["ended_at"] else None

    return wait_for(look, 60.0)


def sent(client: TestClient, folder: Path) -> JSON:
    """Pictures and targets of a folder as the part of a request, or the problem they make."""
    answer = client.post("/v1/picture-sets", content=packed(folder / "pictures"))
    if answer.status_code >= 400:
        return dict(answer.json())
    archive = answer.json()["id"]
    answer = client.post("/v1/target-sets", json=tomllib.loads((folder / "set.toml").read_text()))
    if answer.status_code >= 400:
        return dict(answer.json())
    return {"target_set_id": answer.json()["id"], "pictures": {"picture_set_id": archive}}


def problem_of(client: TestClient, service: Service, path: str, request: JSON) -> JSON:
    """The problem that a request, or its job, ends with; a job leaves no files."""
    answer = client.post(path, json=request)
    if answer.status_code >= 400:
        assert answer.headers["content-type"] == "application/problem+json"
        return dict(answer.json())
    job = ended(client, answer)
    assert job["status"] == "failed", job["result"]
    assert client.get(job["links"]["files"]).json()["items"] == []
    assert client.delete(answer.headers["Location"]).status_code == 204
    assert not files_under(service.store.folder / "work")
    return dict(job["problem"])


def told(problem: JSON) -> str:
    assert 400 <= problem["status"] < 500, problem
    assert "\n" not in problem["detail"]
    assert problem["remedy"]
    return str(problem["detail"])


@pytest.mark.parametrize("name", [n for n in CASES if n != "no TOML"])
def test_bad_pictures_and_targets_over_http(
    tmp_path: Path, client: TestClient, service: Service, pictures: Pictures, name: str
) -> None:
    folder = put(tmp_path / "in", CASES[name], pictures)
    if name == "no folders of cameras":
        (folder / "pictures" / "cam01.png").write_bytes(b"x")
    request = sent(client, folder)
    if "target_set_id" in request:
        request = problem_of(client, service, "/v1/calibrations", request)
    words = "is of no camera" if name == "no folders of cameras" else CASES[name].words
    assert words in told(request)
    assert not files_under(service.store.folder / "tmp")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if c.quick else pytest.mark.slow) for n, c in CASES.items()]
)
def test_bad_pictures_and_targets(tmp_path: Path, pictures: Pictures, name: str) -> None:
    folder = put(tmp_path / "in", CASES[name], pictures)
    line = one_line_and_nothing_left(folder, "calibrate", "pictures", "--targets", "set.toml")
    assert CASES[name].words in line
