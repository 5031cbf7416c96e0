"""Many pictures to observations, and pictures that are refused in one line."""

from __future__ import annotations

import dataclasses
import io
import pickle
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import target_scenes as scenes
from PIL import Image, ImageFilter

from calibration.detection.exposure import unreadable
from calibration.detection.finding import find_targets
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import decoded, picture_from, read_picture
from calibration.detection.opencv import detect_markers
from calibration.detection.pictures import DetectionJob, TakenPicture, detect_pictures
from calibration.detection.unseen import LeaveOut
from calibration.targets.kinds import TargetPlan
from common.errors import CancelledError, InputError
from common.progress import Progress

PLAN = TargetPlan("set", (scenes.PLATE,))


@pytest.fixture(scope="module")
def image() -> np.ndarray:
    view = scenes.camera((300, 240), 500.0)
    return scenes.shot(scenes.PLATE, view, scenes.rotation(15.0, 5.0), 250.0)[0]


@pytest.fixture(scope="module")
def files(image: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> list[TakenPicture]:
    folder = tmp_path_factory.mktemp("pictures")
    out = []
    for camera in ("left", "right"):
        for frame in ("1", "2"):
            path = folder / f"{camera}-{frame}.png"
            Image.fromarray(image).save(path)
            out.append(TakenPicture(camera, frame, path))
    return out


def test_pictures_become_observations(files: list[TakenPicture]) -> None:
    heard: list[Progress] = []
    found = detect_pictures(files, PLAN, progress=heard.append)
    seen = found.observations
    assert (seen.cameras, seen.frames) == (("left", "right"), ("1", "2"))
    assert seen.image_size_px.tolist() == [[300, 240], [300, 240]]
    assert len(seen.pixel) == 4 * len(scenes.PLATE.ids)
    assert found.counts() == {"left": 24, "right": 24}
    assert [p.fraction for p in heard] == [0.25, 0.5, 0.75, 1.0]
    # Row by row the same target of the same picture as in the single detections.
    rows = (seen.camera == 1) & (seen.frame == 0)
    assert [seen.targets.ids[t] for t in seen.target[rows]] == list(found.detections[2].ids)
    assert np.array_equal(seen.pixel[rows], found.detections[2].pixel)


def test_jobs_can_be_sent_elsewhere(files: list[TakenPicture]) -> None:
    job = pickle.loads(pickle.dumps(DetectionJob(files[0], PLAN, Gates())))  # noqa: S301
    sent = pickle.loads(pickle.dumps(job()))  # noqa: S301
    with ThreadPoolExecutor(2) as executor:
        found = detect_pictures(files[:2], PLAN, executor=executor)
    assert np.array_equal(sent.pixel, found.detections[0].pixel)


def test_work_can_be_cancelled(files: list[TakenPicture]) -> None:
    stop = threading.Event()
    with pytest.raises(CancelledError):
        detect_pictures(files, PLAN, progress=lambda _: stop.set(), cancel=stop)
    with ThreadPoolExecutor(1) as executor, pytest.raises(CancelledError):
        detect_pictures(files, PLAN, cancel=stop, executor=executor)


def jpeg(image: np.ndarray, mode: str = "L") -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).convert(mode).save(buffer, "JPEG")
    return buffer.getvalue()


def test_a_broken_jpeg_is_refused(image: np.ndarray) -> None:
    data = jpeg(image)
    assert decoded(data, "whole.jpg").size_px == (300, 240)
    for part in (0.3, 0.9):
        with pytest.raises(InputError, match=r"cut\.jpg is a broken JPEG; copy it"):
            decoded(data[: int(part * len(data))], "cut.jpg")
    with pytest.raises(InputError, match="is a CMYK JPEG"):
        decoded(jpeg(image, "CMYK"), "print.jpg")


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    for data in (b"", b"\x89PNG\r\n", b"hello", b"\xff\xd8\xff"):
        with pytest.raises(InputError, match=r"notes\.txt is (not a picture|a broken JPEG)"):
            decoded(data, "notes.txt")
    with pytest.raises(InputError, match=r"gone\.png cannot be read"):
        read_picture(tmp_path / "gone.png")


@pytest.mark.parametrize(
    ("shape", "kind", "problem"),
    [
        ((40, 40), np.float32, "pixels of type float32"),
        ((40, 40, 2), np.uint8, r"the shape \(40, 40, 2\)"),
        ((40, 40, 4), np.uint8, "a fourth channel that is not opaque"),
        ((4, 40), np.uint8, r"the shape \(4, 40\)"),
    ],
)
def test_arrays_of_other_kinds_are_refused(
    shape: tuple[int, ...], kind: type, problem: str
) -> None:
    with pytest.raises(InputError, match=f"the picture has {problem}"):
        picture_from(np.zeros(shape, kind))


def test_twelve_bits_in_sixteen_are_spread(image: np.ndarray) -> None:
    picture = picture_from(image.astype(np.uint16) * 16)
    assert picture.gain == pytest.approx(255.0 / 4095.0)
    assert np.abs(picture.grey.astype(int) - image).max() <= 1


def test_lists_that_cannot_be_are_refused(image: np.ndarray) -> None:
    one = TakenPicture("left", "1", image)
    cases = (
        ([], "there are no pictures"),
        ([one, one], "2 pictures of camera left in frame 1"),
        (
            [one, TakenPicture("left", "2", np.ascontiguousarray(image[:, 10:]))],
            "the picture of left in frame 2 has 290 x 240 pixels, the picture of left in frame 1",
        ),
        (
            [one, TakenPicture("right", "1", np.full((64, 64), 90, np.uint8))],
            "camera right: it shows no target of set 'set' in its 1 pictures",
        ),
        (
            [TakenPicture("left", "1", np.ascontiguousarray(image[:, ::-1]))],
            "camera left: the picture is mirrored",
        ),
        (
            [TakenPicture("left", "1", image.astype(float))],
            "the picture of left in frame 1 has pix",
        ),
    )
    for pictures, problem in cases:
        with pytest.raises(InputError, match=problem) as caught:
            detect_pictures(pictures, PLAN)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("flip", [np.s_[:, ::-1], np.s_[::-1]], ids=["mirrored", "upside down"])
def test_a_camera_that_sees_a_mirror_image_is_left_out_and_told(
    image: np.ndarray, flip: tuple[slice, ...]
) -> None:
    other = np.ascontiguousarray(image[flip])
    pictures = [TakenPicture(camera, "1", image) for camera in ("left", "right")]
    pictures.insert(1, TakenPicture("behind", "1", other))
    found = detect_pictures(pictures, PLAN, leave_out=LeaveOut.MIRRORED)
    assert found.observations.cameras == ("left", "right")
    assert found.counts() == {"left": 12, "behind": 0, "right": 12}
    (sentence,) = found.left_out
    assert sentence.startswith("behind sees the targets in a mirror only and was left out")
    assert "back_mm" in sentence
    with pytest.raises(InputError, match=r"camera behind: the picture is mirrored.*back_mm"):
        detect_pictures(pictures, PLAN)
    # One camera alone that sees them as they are says nothing about which is right.
    with pytest.raises(InputError, match="camera behind: the picture is mirrored"):
        detect_pictures(pictures[:2], PLAN, leave_out=LeaveOut.MIRRORED)


def test_many_targets_out_of_their_places_are_told(image: np.ndarray) -> None:
    pictures = [TakenPicture("left", "1", image), TakenPicture("right", "1", image)]
    assert detect_pictures(pictures, PLAN).thrown_out() == ()
    found = find_targets(image, PLAN)
    lost = Rejection("plate-000", Rule.HOMOGRAPHY, 2.0, 1.0, (0.0, 0.0))
    some = dataclasses.replace(found, rejections=(lost,) * 4)
    seen = dataclasses.replace(detect_pictures(pictures, PLAN), detections=(found, some))
    (sentence,) = seen.thrown_out()
    assert sentence.startswith("25% of the targets that right saw were not used")


def soft(image: np.ndarray) -> np.ndarray:
    return np.asarray(Image.fromarray(image).filter(ImageFilter.GaussianBlur(6.0)))


def bright(image: np.ndarray) -> np.ndarray:
    return np.clip(image.astype(int) * 4, 0, 255).astype(np.uint8)


BLIND: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str, str]] = {
    "capped": (lambda v: np.full_like(v, 3), "dark", "lens cap"),
    "too bright": (bright, "bright", "see its light"),
    "out of focus": (soft, "soft", "see its focus"),
    "nothing in view": (lambda v: np.full_like(v, 120), "none", "in view"),
}


@pytest.mark.parametrize("name", BLIND)
def test_a_camera_that_sees_nothing_is_told_why(image: np.ndarray, name: str) -> None:
    change, code, remedy = BLIND[name]
    pictures = [TakenPicture(camera, "1", image) for camera in ("left", "right")]
    pictures.insert(1, TakenPicture("blind", "1", change(image)))
    found = detect_pictures(pictures, PLAN, leave_out=LeaveOut.ALL)
    assert {camera: p.code for camera, p in found.problems.items()} == {"blind": code}
    assert remedy in found.problems["blind"].remedy
    assert found.observations.cameras == ("left", "right")
    assert found.left_out == ()
    # A calibration needs every camera, and one camera alone is nothing to compare with.
    for refused, leave_out in ((pictures, LeaveOut.MIRRORED), (pictures[:2], LeaveOut.ALL)):
        with pytest.raises(InputError, match="camera blind: ") as caught:
            detect_pictures(refused, PLAN, leave_out=leave_out)
        assert "\n" not in str(caught.value)


def test_two_targets_in_a_mirror_may_be_read_by_chance(image: np.ndarray) -> None:
    flipped = np.ascontiguousarray(image[:, ::-1])
    assert [f.code for f in find_targets(flipped, PLAN).findings] == ["mirrored"]
    corners = detect_markers(image, scenes.PLATE.dictionary).corners_px
    for marker in corners[2:]:
        x, y = np.rint(marker.mean(axis=0)).astype(int)
        flipped[y - 10 : y + 11, 299 - x - 10 : 299 - x + 11] = 128
    back = np.ascontiguousarray(flipped[:, ::-1])
    assert len(detect_markers(back, scenes.PLATE.dictionary)) == 2
    assert find_targets(flipped, PLAN).findings == ()


def test_pictures_of_one_instant_must_have_one_name(image: np.ndarray) -> None:
    def named(**frames: tuple[str, ...]) -> list[TakenPicture]:
        return [TakenPicture(c, name, image) for c, names in frames.items() for name in names]

    one = named(left=("1", "2"), odd=("A1", "A2"), right=("1", "2"))
    told = "no picture of odd has the name of another camera's picture.*every camera has 2"
    with pytest.raises(InputError, match=told):
        detect_pictures(one, PLAN, leave_out=LeaveOut.MIRRORED)
    found = detect_pictures(one, PLAN, leave_out=LeaveOut.ALL)
    assert list(found.problems) == ["odd"]
    assert found.observations.cameras == ("left", "right")
    for leave_out in LeaveOut:
        with pytest.raises(InputError, match=r"no picture of left has the name.*; rename them$"):
            detect_pictures(named(left=("1",), right=("2", "3")), PLAN, leave_out=leave_out)
    # What stands still needs no pairs.
    still = TargetPlan("set", (dataclasses.replace(scenes.PLATE, fixed=True),))
    assert not detect_pictures(named(left=("1",), right=("2",)), still).problems


def test_a_picture_whose_edges_fill_next_to_nothing_is_explained_too() -> None:
    grey = np.zeros((300, 5200), np.uint8)
    grey[:, :1000] = 200  # an edge of two columns: 0.04 % of the picture
    assert unreadable(picture_from(grey)) is None
