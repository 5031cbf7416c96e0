"""The parameters of a lens, as a calibration's request names them."""

from __future__ import annotations

from enum import StrEnum


class LensParameter(StrEnum):
    """Focal length, principal point, terms of distortion, affinity."""

    f = "f"
    cx = "cx"
    cy = "cy"
    k1 = "k1"
    k2 = "k2"
    p1 = "p1"
    p2 = "p2"
    k3 = "k3"
    b1 = "b1"
    k4 = "k4"
    k5 = "k5"
    k6 = "k6"


class LensChoice(StrEnum):
    """By which equations lenses bend: Brown-Conrady, OpenCV's rational model, Kannala-Brandt."""

    brown = "brown"
    rational = "rational"
    fisheye = "fisheye"


LENS_TERMS = {
    LensChoice.brown: ("k1", "k2", "p1", "p2", "k3"),
    LensChoice.rational: ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    LensChoice.fisheye: ("k1", "k2", "k3", "k4"),
}
"""The terms of each, in the order of ``distortion``."""
