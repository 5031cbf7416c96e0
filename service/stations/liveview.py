"""What a camera of a rig sees now: how sharp, how exposed, and whether it looks where it should."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from calibration.detection.finding import find_targets
from calibration.detection.middles import middle_of
from calibration.targets.files import read_targets
from common.errors import DeviceError
from rig.acquisition.cameras.base import Image
from rig.acquisition.capture.liveview import LivePicture
from rig.acquisition.capture.rig import Rig
from rig.acquisition.imaging import shrunk
from rig.acquisition.looks import Look, look_at, pixels_of, small_jpeg
from rig.design.aiming import Pixel, datum_pixel, turn_to
from service.kinds.base import Figure, Result

SEARCHED_PX = 1600
"""Targets are looked for in a picture of at most so many pixels: it has to be quick."""

_SAME_SHAPE = 0.02
"""Live pictures of a body are of another size; of another shape they do not show what it takes."""


class Aim(Result):
    """Where the datum should be in the camera's pictures, and the turn that brings it there.

    Pixels are of a whole picture as the design has it. The datum is the foremost point of the
    subject, or the origin of the rig's frame where no layout lies beside the design.
    """

    image_size_px: tuple[int, int]
    expected_px: Annotated[
        tuple[float, float] | None, Field(description="Null: not within the picture.")
    ]
    found_px: tuple[float, float] | None = None
    found_by: Annotated[
        Literal["target", "person"] | None,
        Field(description="`target`: the middle of a target that stands at the datum."),
    ] = None
    right_px: Figure = None
    down_px: Figure = None
    pan_deg: Annotated[Figure, Field(description="To the right, as from behind the camera.")] = None
    tilt_deg: Annotated[Figure, Field(description="Up.")] = None
    text: str


class LiveLook(Result):
    """What a camera sees, without a capture."""

    camera: str
    number: Annotated[int, Field(description="Counts the live pictures of this camera.")]
    at: datetime
    image_size_px: Annotated[tuple[int, int], Field(description="Of this picture.")]
    blur_px: Annotated[
        Figure,
        Field(description="Spread of the sharper edges amid it; null where there are no edges."),
    ]
    focus: Annotated[
        float,
        Field(description="For turning the ring: greatest where this camera is sharpest."),
    ]
    white: Annotated[float, Field(description="Share of it that is white.")]
    brightened: Annotated[
        float, Field(description="How much brighter a dark picture is shown; 1 is as it is.")
    ]
    warnings: list[str]
    aim: Annotated[Aim | None, Field(description="Null where no design is known.")]
    links: dict[str, str] = Field(default_factory=dict)


@dataclass(frozen=True)
class Asked:
    """A target file to look for, or where a person sees the datum, in shares of the picture."""

    targets: Path | None = None
    at: Pixel | None = None


def live_look(rig: Rig, name: str, asked: Asked) -> LiveLook:
    """Look through a camera. Raises what :meth:`LiveView.look` raises."""
    picture = rig.live.look(name)
    pixels = _pixels(picture, name)
    look = look_at(pixels)
    return LiveLook(
        camera=name,
        number=picture.number,
        at=picture.at,
        image_size_px=look.size_px,
        blur_px=look.blur_px,
        focus=look.focus,
        white=look.white,
        brightened=small_jpeg(pixels, look)[1],
        warnings=list(look.warnings),
        aim=_aim(rig, name, pixels, look, asked),
    )


def live_jpeg(rig: Rig, name: str, number: int | None) -> bytes:
    """A small live picture: that of ``number`` where it is the last, else what is seen now."""
    picture = None if number is None else rig.live.known(name, number)
    pixels = _pixels(picture or rig.live.look(name), name)
    return small_jpeg(pixels, look_at(pixels))[0]


def _pixels(picture: LivePicture, name: str) -> Image:
    pixels = pixels_of(picture.frame)
    if pixels is None:
        raise DeviceError("camera-error", f"the live picture of {name} is unreadable", "look again")
    return pixels


def _aim(rig: Rig, name: str, pixels: Image, look: Look, asked: Asked) -> Aim | None:
    camera, datum = rig.design.cameras.get(name), rig.design.datum_rig_mm
    if camera is None:
        return None
    size = camera.camera.image_size_px
    expected = datum_pixel(camera, datum)
    scale = _scale(look.size_px, size)
    if scale is None:
        text = "Its live pictures have another shape than those of the design."
        return Aim(image_size_px=size, expected_px=expected, text=text)
    found, by = _found(pixels, asked)
    if found is None or by is None:
        text = "The datum should be at the cross." if expected else "The datum is out of its view."
        return Aim(image_size_px=size, expected_px=expected, text=text)
    whole = ((found[0] + 0.5) * scale - 0.5, (found[1] + 0.5) * scale - 0.5)
    turn = turn_to(camera, datum, whole)
    return Aim(
        image_size_px=size,
        expected_px=expected,
        found_px=whole,
        found_by=by,
        right_px=turn.right_px,
        down_px=turn.down_px,
        pan_deg=turn.pan_deg,
        tilt_deg=turn.tilt_deg,
        text=turn.text,
    )


def _scale(shown_px: tuple[int, int], whole_px: tuple[int, int]) -> float | None:
    """Pixels of a whole picture for each of a live one; None where the shapes differ."""
    across, down = (whole / shown for whole, shown in zip(whole_px, shown_px, strict=True))
    if abs(across / down - 1.0) > _SAME_SHAPE:
        return None
    # Pixels that were put together leave a rest at the border, which would pass for a scale.
    times = round(across)
    put_together = tuple(whole // max(times, 1) for whole in whole_px)
    return float(times) if put_together == shown_px else across


def _found(pixels: Image, asked: Asked) -> tuple[Pixel | None, Literal["target", "person"] | None]:
    height, width = pixels.shape[:2]
    if asked.at is not None:
        return (asked.at[0] * width - 0.5, asked.at[1] * height - 0.5), "person"
    if asked.targets is None:
        return None, None
    plan = read_targets(asked.targets)
    small = shrunk(pixels, SEARCHED_PX)
    scale = small.shape[1] / width
    ordered = small[..., ::-1] if small.ndim == 3 else small
    middle = middle_of(find_targets(ordered, plan, explain=False), plan)
    if middle is None:
        return None, None
    x_px, y_px = middle.pixel
    return ((x_px + 0.5) / scale - 0.5, (y_px + 0.5) / scale - 0.5), "target"
