"""Settings of camera bodies as their menus spell them: ``1/125``, ``0.0080s``, ``f/8``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from common.errors import InputError

WIDGETS: Mapping[str, Sequence[str]] = {
    "exposure_us": ("shutterspeed", "shutterspeed2"),
    "iso": ("iso",),
    "f_number": ("f-number", "aperture"),
}
"""Names under which libgphoto2 shows each field, by maker."""

NEAR = math.log(2.0) / 6.0 + 1e-6
"""Half of a third of a stop: menus go in thirds, so something nearer is there if it is in range."""


def read_value(field: str, spelt: str) -> float | None:
    """The value behind a menu entry, exposure in microseconds; None for ``auto`` and ``bulb``."""
    text = spelt.strip().lower().removeprefix("f/").removeprefix("f").removesuffix("s").strip()
    above, slash, below = text.partition("/")
    try:
        value = float(above) / float(below) if slash else float(text)
    except (ValueError, ZeroDivisionError):
        return None
    if not (math.isfinite(value) and value > 0):
        return None
    return value * 1e6 if field == "exposure_us" else value


def nearest(field: str, wanted: float, choices: Sequence[str]) -> str:
    """The menu entry within a sixth of a stop of what is wanted, in doubt InputError."""
    values = [(choice, read_value(field, choice)) for choice in choices]
    known = [(choice, value) for choice, value in values if value is not None]
    if wanted > 0 and known:
        ranked = sorted(known, key=lambda pair: abs(math.log(pair[1] / wanted)))
        if abs(math.log(ranked[0][1] / wanted)) <= NEAR:
            return ranked[0][0]
        near = ", ".join(choice for choice, _ in ranked[:2])
        raise InputError("camera-setting", f"{field}: no setting near {wanted:g}", f"try {near}")
    raise InputError(
        "camera-setting",
        f"{field}: {wanted:g} cannot be set",
        "put the body into manual mode, and choose a value from its menu",
    )
