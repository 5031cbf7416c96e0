"""What OpenCV gives by itself: the other side of comparisons, and videos frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from calibration.detection.opencv import Bytes, Markers


def plain_markers(grey: Bytes, dictionary: str) -> Markers:
    """Markers with OpenCV's own sub-pixel corners."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    corners, ids, _ = cv2.aruco.ArucoDetector(known, parameters).detectMarkers(grey)
    if ids is None or len(corners) == 0:
        return Markers(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 2)))
    places = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)
    return Markers(np.asarray(ids, dtype=np.int64).reshape(-1), places)


def video_frames(path: Path) -> Iterator[Bytes]:
    """The frames of a video as grey pictures, one after the other."""
    video = cv2.VideoCapture(str(path))
    try:
        assert video.isOpened(), path
        while True:
            more, image = video.read()
            if not more:
                return
            yield np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    finally:
        video.release()
