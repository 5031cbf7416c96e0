"""Pictures of the practice's plate in the places of those that a capture filed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from service.practice import write_practice

SIZE_PX = (1500, 1000)


def practice_in(folder: Path) -> Path:
    """The practice's files in a folder ``practice``."""
    place = folder / "practice"
    place.mkdir()
    write_practice(place)
    return place


def put_plate(practice: Path, session: Path, record: dict[str, Any]) -> None:
    """The plate in the upper left quarter of the first camera's picture, and in no other."""
    plate = cv2.imread(str(practice / "plate.png"), cv2.IMREAD_GRAYSCALE)
    scale = 480 / plate.shape[0]
    small = cv2.resize(plate, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    for k, frame in enumerate(record["frames"]):
        picture = np.full(SIZE_PX[::-1], 235, np.uint8)
        if k == 0:
            picture[10 : 10 + small.shape[0], 10 : 10 + small.shape[1]] = small
        path = session / frame["file"]["path"]
        path.write_bytes(cv2.imencode(path.suffix, picture)[1].tobytes())
