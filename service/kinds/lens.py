"""The parameters of a lens, as a calibration's request names them."""

from __future__ import annotations

from enum import StrEnum


class LensParameter(StrEnum):
    """Focal length, principal point, distortion (Brown-Conrady), affinity and shear."""

    f = "f"
    cx = "cx"
    cy = "cy"
    k1 = "k1"
    k2 = "k2"
    p1 = "p1"
    p2 = "p2"
    k3 = "k3"
    b1 = "b1"
