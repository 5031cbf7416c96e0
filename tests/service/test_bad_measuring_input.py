"""Bad pictures, target files and references through both doors: one line, and nothing left."""

from __future__ import annotations

import io
import json
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
from service_helpers import (
    InThisProcess,
    TestClient,
    files_under,
    one_line_and_nothing_left,
    rigwright,
    wait_for,
)

from common.errors import ConflictError
from rig.acquisition.session.folder import Session, SessionPlan
from rig.design.designfile import placed_camera
from service.api.app import create_app
from service.api.context import Service
from service.kinds.queued import QUEUED
from service.settings import read_settings

JSON = dict[str, Any]
Make = Callable[[Path, Pictures], object]
CAMERAS = rig()[:3]
slow = pytest.mark.slow


@dataclass(frozen=True)
class Case:
    """What is put into ``pictures``, the target file, and words of what is said of them."""

    words: str
    make: Make
    targets: str = PLATE_TOML
    slow: bool = False
    """Whether it is slow over HTTP, too."""


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


def loose(folder: Path, pictures: Pictures) -> object:
    return write_pictures(folder, {".": pictures["cam01"]})


def own_names(*cameras: str) -> Make:
    """Pictures of some cameras called by each camera's own counter."""

    def make(folder: Path, pictures: Pictures) -> object:
        named = {
            camera: {f"{camera}-{frame}" if camera in cameras else frame: v for frame, v in own}
            for camera, own in ((c, frames.items()) for c, frames in pictures.items())
        }
        return write_pictures(folder, named)

    return make


def mirrored(picture: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(picture[:, ::-1])


def with_alpha(alpha: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda v: np.dstack([v, v, v, np.full_like(v, alpha)])


QUICK = "a broken JPEG"
"""What the command line is tried with among the quick tests."""
IN_A_PROCESS = "a text"
"""What goes through the door of a process of its own, as a user comes; the others say the same."""

same = each(lambda picture: picture)

CASES: dict[str, Case] = {
    "no targets": Case("shows no target", each(lambda v: np.full_like(v, 120))),
    "one camera only": Case("1 camera only", one_camera),
    "all mirrored": Case("camera cam01: the picture is mirrored", each(mirrored)),
    "one camera's own names": Case("no picture of cam02 has the name", own_names("cam02")),
    "mixed sizes": Case("01.png has 320 x 240 pixels", one(smaller)),
    "columns and rows exchanged": Case(
        "exchange columns and rows",
        same,
        PLATE_TOML.replace("columns = 6", "columns = 5").replace("rows = 5", "rows = 6"),
        slow=True,
    ),
    "another board": Case(
        "has 6 columns, not 7",
        same,
        PLATE_TOML.replace("columns = 6", "columns = 7"),
        slow=True,
    ),
    "another dictionary": Case(
        "markers of DICT_4X4_50, none of DICT_5X5_50",
        same,
        PLATE_TOML.replace("4X4", "5X5"),
        slow=True,
    ),
    "no such dictionary": Case("DICT_4X4_50", same, PLATE_TOML.replace("4X4_50", "4X4_51")),
    "metres": Case(
        "give millimetres", same, PLATE_TOML.replace("25.0", "0.025").replace("18.0", "0.018")
    ),
    "a broken JPEG": Case("cam02/01.jpg is a broken JPEG", one(halved, ".jpg")),
    "a broken PNG": Case("cam02/01.png is not a picture", one(halved)),
    "a text": Case("cam02/01.png is not a picture", one(lambda p: p.write_text("hello"))),
    "transparent": Case("a fourth channel that is not opaque", each(with_alpha(200), "cam02")),
    "fractions": Case(
        "pixels of type float32", each(lambda v: v.astype(np.float32) / 255.0, suffix=".tif")
    ),
    "tiny": Case("cam01/00.png has the shape (8, 8)", each(lambda v: v[:8, :8])),
    "always the same view": Case("tilt the plate", straight_on, slow=True),
    "a misspelt key": Case(
        "did you mean square_mm", same, PLATE_TOML.replace("square_mm", "sqare_mm")
    ),
    "no carriers": Case("has no targets", same, 'schema = "rigwright.targets/1"\nname = "x"\n'),
    "no TOML": Case("is not a target file", same, PLATE_TOML.replace("[[plates]]", "[[plates]")),
    "an empty folder": Case("holds no pictures", lambda folder, _: folder.mkdir()),
    "no folders of cameras": Case("no folders of cameras", loose),
}


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
    opened = Service(settings, QUEUED, InThisProcess())
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
    wait_for(lambda: not files_under(service.store.folder / "work"))
    return dict(job["problem"])


def told(problem: JSON) -> str:
    assert 400 <= problem["status"] < 500, problem
    assert "\n" not in problem["detail"]
    assert problem["remedy"]
    return str(problem["detail"])


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=slow if c.slow else ()) for n, c in CASES.items() if n != "no TOML"],
)
def test_bad_pictures_and_targets_over_http(
    tmp_path: Path, client: TestClient, service: Service, pictures: Pictures, name: str
) -> None:
    folder = put(tmp_path / "in", CASES[name], pictures)
    request = sent(client, folder)
    if "target_set_id" in request:
        request = problem_of(client, service, "/v1/calibrations", request)
    words = "is of no camera" if name == "no folders of cameras" else CASES[name].words
    assert words in told(request)
    assert not files_under(service.store.folder / "tmp")


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n == QUICK else slow) for n, c in CASES.items()],
)
def test_bad_pictures_and_targets(tmp_path: Path, pictures: Pictures, name: str) -> None:
    folder = put(tmp_path / "in", CASES[name], pictures)
    line = one_line_and_nothing_left(
        folder, "calibrate", "pictures", "--targets", "set.toml", here=name != IN_A_PROCESS
    )
    assert CASES[name].words in line


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, client: TestClient, pictures: Pictures
) -> tuple[Path, JSON]:
    """A folder with a calibration beside its pictures, and the calibration over HTTP."""
    folder = put(tmp_path_factory.mktemp("made") / "in", Case("", same), pictures)
    job = ended(client, client.post("/v1/calibrations", json=sent(client, folder)))
    assert job["status"] == "completed", job["problem"]
    (folder / "calibration").mkdir()
    content = client.get(f"{job['links']['self']}/calibration").content
    (folder / "calibration" / "calibration.json").write_bytes(content)
    shutil.copyfile(folder / "set.toml", folder / "calibration" / "targets.toml")
    return folder, job


@pytest.fixture
def folder(tmp_path: Path, made: tuple[Path, JSON]) -> Path:
    return Path(shutil.copytree(made[0], tmp_path / "in"))


RENAMED = {f"cam{k:02d}": f"left{k:02d}" for k in (1, 2, 3)}


def other_names(folder: Path, pictures: Pictures) -> object:
    return write_pictures(folder, {RENAMED[name]: frames for name, frames in pictures.items()})


CHECKED: dict[str, tuple[str, Make]] = {
    "of another rig": ("'left01' is not in the ", other_names),
    "of another size": ("cam01' has images of 320 x 240 px", each(lambda v: v[:240, :320])),
    "mirrored": ("the picture is mirrored", each(mirrored)),
    "of own names": ("no picture of cam01 has the name", own_names("cam01", "cam02", "cam03")),
}


@pytest.mark.parametrize("what", ["checks", pytest.param("acceptances", marks=slow)])
@pytest.mark.parametrize("name", CHECKED)
def test_pictures_that_are_not_of_the_calibrated_rig(
    tmp_path: Path,
    client: TestClient,
    service: Service,
    pictures: Pictures,
    made: tuple[Path, JSON],
    name: str,
    what: str,
) -> None:
    words, make = CHECKED[name]
    request = sent(client, put(tmp_path / "in", Case(words, make), pictures))
    request["calibration_id"] = made[1]["id"]
    assert words in told(problem_of(client, service, f"/v1/{what}", request))


BLIND: dict[str, tuple[str, str, Make]] = {
    "capped": ("camera-missing", "too dark", each(lambda v: np.full_like(v, 3), "cam02")),
    "of own names": ("unsynchronised", "No picture of cam02 has the name", own_names("cam02")),
}


@pytest.mark.parametrize("name", BLIND)
def test_a_check_goes_on_without_a_camera_whose_pictures_cannot_be_used(
    tmp_path: Path, client: TestClient, pictures: Pictures, made: tuple[Path, JSON], name: str
) -> None:
    kind, words, make = BLIND[name]
    request = sent(client, put(tmp_path / "in", Case(words, make), pictures))
    request["calibration_id"] = made[1]["id"]
    job = ended(client, client.post("/v1/checks", json=request))
    assert job["status"] == "completed", job["problem"]
    result = job["result"]
    assert result["light"] == "red"
    first, *others = result["findings"]
    assert (first["kind"], first["subjects"]) == (kind, ["cam02"])
    assert words in first["text"]
    # Two cameras that are left say little of each other, and nothing false.
    assert {f["kind"] for f in others} <= {"cannot-tell"}


@slow
@pytest.mark.parametrize("command", ["check", "accept"])
@pytest.mark.parametrize("name", CHECKED)
def test_pictures_that_are_not_of_the_calibrated_rig_at_the_terminal(
    folder: Path, pictures: Pictures, name: str, command: str
) -> None:
    words, make = CHECKED[name]
    shutil.rmtree(folder / "pictures")
    make(folder / "pictures", pictures)
    targets = ("--targets", "set.toml")
    line = one_line_and_nothing_left(
        folder, command, "pictures", "--reference", "calibration", *targets, here=True
    )
    assert words in line


@slow
def test_references_that_are_none(folder: Path) -> None:
    def line(*more: object, command: str = "check") -> str:
        return one_line_and_nothing_left(folder, command, "pictures", *more, here=True)

    whole = folder / "calibration" / "calibration.json"
    (folder / "half.json").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    (folder / "design.json").write_text('{"schema": "rigwright.design/1", "cameras": []}')
    targets = ("--targets", "set.toml")
    assert "half.json is not JSON" in line("--reference", "half.json", *targets)
    for command in ("check", "accept"):
        told = line("--reference", "design.json", *targets, command=command)
        assert "rigwright.calibration/1" in told
    assert "there is no file nothing" in line("--reference", "nothing", *targets)
    assert "give --targets" in line("--reference", "half.json")
    assert "there is no file nothing" in line("--reference", "nothing")
    (folder / "empty").mkdir()
    assert "the folder empty holds no calibration.json" in line("--reference", "empty")
    (folder / "history").write_text("")
    reference = ("--reference", "calibration")
    assert "history is no folder; give a folder" in line(*reference, "--history", "history")
    (folder / "checks").mkdir()
    (folder / "checks" / "check-1.json").write_text("{")
    assert "check-1.json is not JSON" in line(*reference, "--history", "checks")
    accept = (*reference, *targets, "--limit")
    assert "permits no error" in line(*accept, 0, 0, 1, command="accept")
    assert "width_mm: it should be greater than 0" in line(
        *accept, 9, 9, 9, "--volume", 0, 1, 1, command="accept"
    )


@slow
def test_requests_that_contradict_themselves(folder: Path) -> None:
    def line(*more: object) -> str:
        return one_line_and_nothing_left(
            folder, "calibrate", *more, "--targets", "set.toml", here=True
        )

    assert "give the design" in line("pictures", "--poses-known-to", 1, 1)
    assert "f is among hold and among free" in line("pictures", "--hold", "f", "--free", "f")
    assert "is no session" in line("pictures", "--capture", "one")
    assert "there is no file pictrues" in line("pictrues")
    Session.create(folder / "empty", SessionPlan("studio", "0" * 64)).close()
    assert "take a capture first" in line("empty")
    assert "has no capture 'one'" in line("empty", "--capture", "one")


def test_requests_that_contradict_themselves_over_http(
    client: TestClient, service: Service, made: tuple[Path, JSON]
) -> None:
    request = sent(client, made[0])

    def problem(path: str = "/v1/calibrations", **more: object) -> str:
        return told(problem_of(client, service, path, request | more))

    Session.create(service.settings.sessions_folder / "empty", SessionPlan("s", "0" * 64)).close()
    assert "take a capture first" in problem(pictures={"session": "empty"})
    assert "there is no session 'gone'" in problem(pictures={"session": "gone"})
    assert "give picture_set_id or session" in problem(pictures={})
    known = {"position_sigma_mm": 1.0, "rotation_sigma_deg": 1.0}
    assert "give design_id" in problem(poses_known_to=known)
    assert "f is among hold" in problem(hold=["f"], free=["f"])
    assert "did you mean design_id" in problem(desing_id="x")
    assert "calibration" in problem("/v1/checks", calibration_id="gone")
    limit = {"a_um": 0.0, "k_um_per_m": 0.0}
    acceptance = {"calibration_id": made[1]["id"], "limit": limit}
    assert "permits no error" in problem("/v1/acceptances", **acceptance)


def test_the_folder_with_the_pictures_is_not_replaced(folder: Path) -> None:
    from common.files.folders import new_folder

    with (
        pytest.raises(ConflictError, match="would be lost; give another --out"),
        new_folder(folder, force=True, spare=[folder / "pictures"]),
    ):
        raise AssertionError("the folder was given")
    assert (folder / "pictures" / "cam01" / "00.png").is_file()


@slow
def test_targets_that_cannot_be_printed(folder: Path, client: TestClient) -> None:
    def line(*more: object) -> str:
        return one_line_and_nothing_left(folder, "targets", *more, here=True)

    assert "give a target set to print" in line()
    assert "there is no page 'A9'" in line("set.toml", "--page", "A9")
    assert "take a larger page" in line("set.toml", "--page", "80x80")
    (folder / "design.json").write_text('{"schema": "rigwright.design/1", "cameras": []}')
    assert "; " in line("--design", "design.json")
    (folder / "wrong.toml").write_text(PLATE_TOML.replace("rows = 5", "rows = 5.5"))
    assert "plates[0].rows is 5.5; it should be a valid integer" in line("wrong.toml")
    answer = client.post("/v1/target-sets", json=tomllib.loads(PLATE_TOML))
    for page, words in (("A9", "no page"), ("80x80", "larger page")):
        assert words in told(client.get(answer.json()["links"]["sheets"] + f"?page={page}").json())


@pytest.mark.parametrize(
    "change",
    ["16 bits", pytest.param("12 bits in 16", marks=slow), pytest.param("opaque", marks=slow)],
)
def test_deep_and_opaque_pictures_are_good(
    tmp_path: Path, client: TestClient, pictures: Pictures, made: tuple[Path, JSON], change: str
) -> None:
    deep = {
        "16 bits": lambda v: v.astype(np.uint16) * 257,
        "12 bits in 16": lambda v: v.astype(np.uint16) * 16,
        "opaque": with_alpha(255),
    }
    case = Case("", each(deep[change]))
    request = sent(client, put(tmp_path / "in", case, pictures))
    request["calibration_id"] = made[1]["id"]
    job = ended(client, client.post("/v1/checks", json=request))
    assert job["result"]["light"] == "green"
    # The same pictures: 12 bits round them by less than a hundredth of their noise.
    assert job["result"]["rms_px"] == pytest.approx(made[1]["result"]["rms_px"], rel=0.05)


@slow
def test_targets_in_another_unit_are_told_from_the_design(folder: Path) -> None:
    centimetres = PLATE_TOML.replace("25.0", "2.5").replace("18.0", "1.8")
    (folder / "set.toml").write_text(centimetres)
    design = {"schema": "rigwright.design/1", "cameras": [placed_camera(c) for c in CAMERAS]}
    (folder / "design.json").write_text(json.dumps(design))
    calibrate = ("calibrate", "pictures", "--targets", "set.toml")
    line = one_line_and_nothing_left(folder, *calibrate, "--design", "design.json", here=True)
    assert "centimetres" in line
    # Without a design nothing says that the rig is not so small; a warning asks.
    done = rigwright(*calibrate, "--out", "out", "--json", cwd=folder)
    assert "not in millimetres" in json.loads(done.stdout)["result"]["warnings"][0]
