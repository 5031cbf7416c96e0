"""Detection on photographs and videos by others. Nothing was tuned to them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from plain_opencv import video_frames

from calibration.detection import opencv
from calibration.detection.finding import find_targets
from calibration.detection.gates import Gates
from calibration.detection.images import read_picture
from calibration.detection.markers import marker_points
from calibration.detection.opencv import Markers
from calibration.targets.kinds import CharucoPlate, MarkerCarrier, TargetPlace, TargetPlan
from geometry.arrays import Floats

pytestmark = pytest.mark.slow


def folder(name: str) -> Path:
    for parent in Path(__file__).resolve().parents:
        for root in (parent / "shared", parent.parent / "shared"):
            if (found := root / "data" / "calibration" / name).is_dir():
                return found
    pytest.skip("needs the real calibration pictures in ../shared/data")


def listed(path: Path) -> Floats:
    """Corners (n, 4, 2) as listed; the list has pixel centres at halves."""
    rows = [re.findall(r"-?\d+\.?\d*", line) for line in path.read_text().splitlines()]
    return np.array([[float(v) for v in row[1:]] for row in rows]).reshape(-1, 4, 2) - 0.5


def test_corners_of_april_tags_lie_where_they_are_listed() -> None:
    matched = []
    for path in sorted(folder("apriltag").glob("*.jpg")):
        picture, truth = read_picture(path), listed(path.with_suffix(".txt"))
        markers = opencv.detect_markers(picture.grey, "DICT_APRILTAG_36H11")
        tags = MarkerCarrier("tags", "DICT_APRILTAG_36H11", 100.0, (TargetPlace(0),), corners=True)
        # All tags show number 0, so one is taken at a time.
        for corners in markers.corners_px:
            points, _ = marker_points(
                picture, tags, Markers(np.zeros(1, int), corners[None]), Gates()
            )
            if not points:
                continue
            own = np.array([p.pixel for p in points])
            nearest = truth[np.argmin(np.linalg.norm(truth.mean(1) - own.mean(0), axis=1))]
            if np.linalg.norm(nearest.mean(0) - own.mean(0)) < 5.0:
                turns = [np.roll(nearest[::s], k, axis=0) - own for s in (1, -1) for k in range(4)]
                matched.append(min(turns, key=lambda e: float((e**2).sum())))
    off = np.array(matched)
    assert len(off) >= 20
    # Tags of 14 to 35 pixels in JPEGs; another convention of the pixel centre would show as 0.5.
    assert np.median(np.abs(off)) < 0.35
    assert np.abs(np.median(off, axis=(0, 1))).max() < 0.25


def test_the_plate_of_the_four_webcams_is_found() -> None:
    plate = CharucoPlate("plate", 4, 5, 54.0, 40.5, "DICT_4X4_1000", inverted=True)
    plan = TargetPlan("webcams", (plate,))
    videos = sorted((folder("caliscope") / "charuco_calibration").rglob("cam_?.mp4"))
    assert len(videos) == 4
    for video in videos:
        own, plain, apart = 0, 0, []
        for number, frame in enumerate(video_frames(video)):
            if number % 8:
                continue
            found = find_targets(frame, plan, explain=False)
            numbers, pixels = opencv.plain_charuco(255 - frame, (4, 5), 54.0, 40.5, "DICT_4X4_1000")
            theirs = {plate.ids[n]: p for n, p in zip(numbers, pixels, strict=True)}
            own, plain = own + len(found), plain + len(theirs)
            apart += [found.pixel[k] - theirs[i] for k, i in enumerate(found.ids) if i in theirs]
        assert own >= 0.95 * plain
        assert np.abs(np.median(apart, axis=0)).max() < 0.1


def test_markers_in_the_webcam_frames_are_found() -> None:
    shots = sorted((folder("caliscope") / "aruco_extrinsic").glob("cam_*_frame_*.jpg"))
    assert len(shots) == 36
    own = plain = 0
    for path in shots:
        picture = read_picture(path)
        markers = opencv.detect_markers(picture.grey, "DICT_4X4_100")
        numbers = sorted(set(markers.ids.tolist()))
        if not numbers:
            continue
        places = tuple(TargetPlace(number) for number in numbers)
        carrier = MarkerCarrier("markers", "DICT_4X4_100", 100.0, places)
        found = find_targets(picture, TargetPlan("set", (carrier,)), explain=False)
        own, plain = own + len(found), plain + len(numbers)
        assert len(found) + len({r.target for r in found.rejections}) >= len(numbers)
    assert own >= 0.7 * plain
