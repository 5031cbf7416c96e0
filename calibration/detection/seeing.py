"""Square markers in a picture, each dictionary looked for once, large pictures made smaller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.detection import opencv
from calibration.detection.images import Picture
from calibration.detection.opencv import Markers
from calibration.targets.boards import AprilGrid
from calibration.targets.kinds import CarrierKind, CharucoPlate, MarkerCarrier, marker_numbers

_LARGE_PX = 3000
_REDUCED_PX = 2000
_SURE_SIDE_PX = 26.0
"""Markers of this side in the reduced picture are found there; about half of it is the limit."""


class MarkerSearch:
    """One picture and the markers already looked for in it."""

    def __init__(self, picture: Picture) -> None:
        self.picture = picture
        self._seen: dict[tuple[str, int], Markers] = {}

    def markers(
        self, dictionary: str, carriers: Sequence[CarrierKind], border_modules: int = 1
    ) -> Markers:
        """Markers of a dictionary with a black border so many modules wide.

        A large picture is searched made smaller, and searched again as it is when one of the
        ``carriers`` is missing in it, or shows markers so small that others may be missing.
        """
        key = dictionary, border_modules
        if key not in self._seen:
            self._seen[key] = self._search(dictionary, carriers, border_modules)
        return self._seen[key]

    def _search(
        self, dictionary: str, carriers: Sequence[CarrierKind], border_modules: int
    ) -> Markers:
        grey = self.picture.grey
        if max(grey.shape) < _LARGE_PX:
            return opencv.detect_markers(grey, dictionary, border_modules=border_modules)
        factor = round(max(grey.shape) / _REDUCED_PX)
        small = opencv.detect_markers(
            opencv.reduced(grey, factor), dictionary, True, border_modules
        )
        found = Markers(small.ids, small.corners_px * factor + (factor - 1) / 2.0)
        if _complete(found, _SURE_SIDE_PX * factor, dictionary, carriers):
            return found
        return opencv.detect_markers(grey, dictionary, border_modules=border_modules)


def _complete(
    markers: Markers, sure_px: float, dictionary: str, carriers: Sequence[CarrierKind]
) -> bool:
    """Whether all markers of the carriers that are in the picture can be taken as found."""
    seen = set(markers.ids.tolist())
    sides = np.linalg.norm(markers.corners_px - np.roll(markers.corners_px, 1, axis=1), axis=2)
    smallest = dict(zip(markers.ids.tolist(), sides.min(axis=1, initial=np.inf), strict=True))
    for carrier in carriers:
        if not isinstance(carrier, CharucoPlate | AprilGrid | MarkerCarrier):
            continue
        if carrier.dictionary != dictionary:
            continue
        wanted = {number for _, number in marker_numbers(carrier)}
        mine = wanted & seen
        if mine != wanted and (not mine or min(smallest[k] for k in mine) < sure_px):
            return False
    return True
