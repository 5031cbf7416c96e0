"""Where a filed picture shows targets: what part of a camera's field is still empty."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from calibration.detection.finding import find_targets
from calibration.fieldcells import GRID, cells_of
from calibration.targets.files import read_targets
from rig.acquisition.imaging import decoded, shrunk
from service.kinds.base import Result
from service.stations.judged import picture_bytes, picture_of
from service.stations.liveview import SEARCHED_PX

_KEPT = 4096


class FieldSeen(Result):
    """Where a filed picture shows targets."""

    path: str
    camera: str
    targets: int
    grid: Annotated[int, Field(description="So many cells the field has along each side.")] = GRID
    cells: Annotated[
        list[tuple[int, int]],
        Field(description="Cells that show targets: column from the left, row from above, from 0."),
    ]


def field_seen(folder: Path, path: str, targets: Path) -> FieldSeen:
    """Where the picture that a record names ``path`` shows targets of the file ``targets``.

    Raises :class:`~common.errors.NotFoundError` for no picture. The picture is looked at smaller,
    so that finest targets may go unseen that a calibration finds. Takes a core for about a second.
    """
    frame = picture_of(folder, path)
    count, cells = _seen(folder / path, frame.file.sha256, targets)
    return FieldSeen(path=path, camera=frame.camera, targets=count, cells=list(cells))


@lru_cache(maxsize=_KEPT)
def _seen(path: Path, sha256: str, targets: Path) -> tuple[int, tuple[tuple[int, int], ...]]:
    """Of files with contents that never change."""
    del sha256
    pixels = decoded(picture_bytes(path))
    if pixels is None:
        return 0, ()
    small = shrunk(pixels, SEARCHED_PX)
    ordered = np.ascontiguousarray(small[..., ::-1]) if small.ndim == 3 else small
    found = find_targets(ordered, read_targets(targets), explain=False)
    size = (small.shape[1], small.shape[0])
    return len(found), tuple((int(x), int(y)) for x, y in cells_of(found.pixel, size))
