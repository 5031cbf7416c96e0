"""Findings in plain sentences: what a technician reads first."""

from __future__ import annotations


def joined(names: tuple[str, ...] | list[str]) -> str:
    """Names as people list them."""
    names = list(names)
    if len(names) > 6:
        names = [*names[:5], f"{len(names) - 5} others"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def length(mm: float) -> str:
    """A length with the unit that suits it."""
    return f"{mm * 1e3:.2g} um" if abs(mm) < 0.1 else f"{mm:.2g} mm"


def pixels(px: float) -> str:
    """A length in the image."""
    return f"{px:.0f} px" if px >= 10.0 else f"{px:.2g} px"


def moved(camera: str, px: float, mm: float) -> str:
    """A camera moved."""
    return (
        f"Camera {camera} has moved: its image points are off by {pixels(px)}, which shifts points "
        f"at the subject by {length(mm)}."
    )


def either(cameras: tuple[str, ...]) -> str:
    """One of several cameras moved, and the images cannot tell which."""
    return (
        f"One of {joined(cameras)} has moved, but the images cannot tell which; "
        "a third camera would."
    )


def lens(camera: str, px: float, mm: float, focal_share: float) -> str:
    """A lens changed; its focal length has turned negative where the whole image is turned."""
    if focal_share < -1.0:
        return (
            f"The images of camera {camera} are turned by 180 degrees against the reference: its "
            f"image points are off by {pixels(px)}. Turn them back, or calibrate anew."
        )
    return (
        f"The lens of camera {camera} has changed (focal length by {focal_share:+.2%}): its image "
        f"points are off by {pixels(px)}, which shifts points at the subject by {length(mm)}."
    )


def target_moved(targets: tuple[str, ...], carrier: str, mm: float) -> str:
    """Single targets of a carrier moved."""
    return (
        f"On {carrier}, {joined(targets)} moved by up to {length(mm)} against the other targets; "
        "the cameras are not to blame."
    )


def bent(carrier: str, mm: float) -> str:
    """A carrier has another shape."""
    return (
        f"Carrier {carrier} has changed its shape by up to {length(mm)}: it is bent or was "
        "replaced; the cameras are not to blame."
    )


def printed(carrier: str, scale: float) -> str:
    """A carrier has another size."""
    if abs(scale - 1.0) > 0.002:
        return (
            f"Carrier {carrier} is {scale:.1%} of its size in the reference: "
            "it was printed at another scale."
        )
    return f"Carrier {carrier} is {1e6 * (scale - 1.0):+.0f} ppm larger than in the reference."


def scale(ppm: float) -> str:
    """Everything has another size."""
    return (
        f"All targets measure {ppm:+.0f} ppm larger than in the reference: the rig has changed its "
        "size, for instance with its temperature, or all targets have."
    )


def ids(pairs: tuple[tuple[str, str], ...]) -> str:
    """Targets carry each other's ids."""
    reported = ", ".join(f"{a} is where {b} belongs" for a, b in pairs[:4])
    more = f" and {len(pairs) - 4} more" if len(pairs) > 4 else ""
    return f"Targets carry swapped ids: {reported}{more}."


def cameras_swapped(names: tuple[str, ...]) -> str:
    """Cameras have each other's images."""
    return f"The images of cameras {joined(names)} are swapped."


def unsynchronised(cameras: tuple[str, ...], frames: tuple[str, ...], px: float) -> str:
    """Cameras saw moving carriers elsewhere than the others did."""
    when = f" in {joined(frames)}" if frames else ""
    return (
        f"Cameras did not expose together: {joined(cameras)} saw moving targets up to {pixels(px)} "
        f"from where the others saw them{when}. Check trigger, exposure times and pairing."
    )


def noise(camera: str, factor: float) -> str:
    """Image points scatter more than they should."""
    return (
        f"Image points of {camera} scatter {factor:.1f} times as much as in the reference: check "
        "its focus, light, exposure, and whether its lens is clean."
    )


def unexplained(ratio: float) -> str:
    """Nothing known explains the images."""
    return (
        f"The images do not fit the reference ({ratio:.1f} times the expected misfit) and no "
        "single cause explains it: most cameras moved, or it is the wrong reference. "
        "Calibrate anew."
    )


def most_cameras(cameras: tuple[str, ...]) -> str:
    """So many cameras changed that the others cannot tell which."""
    return (
        f"No two of {joined(cameras)} agree with the reference any more: most of them moved, and "
        "the images cannot tell which. Calibrate anew."
    )


def few(cameras: tuple[str, ...], count: int) -> str:
    """Cameras saw too little."""
    return (
        f"Nothing can be said of {joined(cameras)}: too few targets (at least {count} are needed)."
    )


def weak(cameras: tuple[str, ...], mm: float) -> str:
    """Movements could hide."""
    return (
        f"Movements of {joined(cameras)} that shift points by up to {length(mm)} could have gone "
        "unseen: show more targets, spread over the whole image."
    )


def fine(cameras: int, mm: float) -> str:
    """Nothing happened."""
    return (
        f"All {cameras} cameras are where they were; a movement that shifts points at the subject "
        f"by {length(mm)} would have been reported in 95 of 100 checks."
    )
