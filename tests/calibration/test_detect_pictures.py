"""Many pictures to observations, and pictures that are refused in one line."""

from __future__ import annotations

import dataclasses
import io
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import target_scenes as scenes
from PIL import Image

from calibration.detection.finding import find_targets
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import decoded, picture_from, read_picture
from calibration.detection.pictures import DetectionJob, TakenPicture, detect_pictures
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
            "camera right shows no target of set 'set' in its 1 pictures",
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
    found = detect_pictures(pictures, PLAN, leave_mirrored=True)
    assert found.observations.cameras == ("left", "right")
    assert found.counts() == {"left": 12, "behind": 0, "right": 12}
    (sentence,) = found.left_out
    assert sentence.startswith("behind sees the targets in a mirror only and was left out")
    assert "back_mm" in sentence
    with pytest.raises(InputError, match=r"camera behind: the picture is mirrored.*back_mm"):
        detect_pictures(pictures, PLAN)
    # One camera alone that sees them as they are says nothing about which is right.
    with pytest.raises(InputError, match="camera behind: the picture is mirrored"):
        detect_pictures(pictures[:2], PLAN, leave_mirrored=True)


def test_many_targets_out_of_their_places_are_told(image: np.ndarray) -> None:
    pictures = [TakenPicture("left", "1", image), TakenPicture("right", "1", image)]
    assert detect_pictures(pictures, PLAN).thrown_out() == ()
    found = find_targets(image, PLAN)
    lost = Rejection("plate-000", Rule.HOMOGRAPHY, 2.0, 1.0, (0.0, 0.0))
    some = dataclasses.replace(found, rejections=(lost,) * 4)
    seen = dataclasses.replace(detect_pictures(pictures, PLAN), detections=(found, some))
    (sentence,) = seen.thrown_out()
    assert sentence.startswith("25% of the targets that right saw were not used")
