"""Findings in plain sentences: what a technician reads first."""

from __future__ import annotations

MANY_PPM = 5000.0
"""From there on people think in per cent."""


def joined(names: tuple[str, ...] | list[str]) -> str:
    """Names as people list them."""
    names = list(names)
    if len(names) > 6:
        names = [*names[:5], f"{len(names) - 5} others"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def length(mm: float) -> str:
    """A length with the unit that suits it."""
    # What rounds to 0.10 mm is told as that, not as 1e+02 um.
    return f"{mm * 1e3:.2g} um" if abs(mm) < 0.0995 else f"{mm:.2g} mm"


def pixels(px: float) -> str:
    """A length in the image."""
    return f"{px:.0f} px" if px >= 10.0 else f"{px:.2g} px"


def moved(camera: str, px: float, mm: float) -> str:
    """A camera moved."""
    return (
        f"Camera {camera} has moved: its image points are off by {pixels(px)}, which shifts points "
        f"at the subject by up to {length(mm)}."
    )


def missing(cameras: tuple[str, ...]) -> str:
    """Cameras that showed nothing."""
    have = "has" if len(cameras) == 1 else "have"
    return (
        f"{joined(cameras)} {have} no picture with a target in it: check its power, its cable and "
        "its view, and take the pictures again."
    )


def unseeing(camera: str, problem: str, remedy: str) -> str:
    """A camera in whose pictures nothing can be read, and why."""
    own = problem.removeprefix("it ")
    told = own if own != problem else f"shows no target: {problem}"
    return f"Camera {camera} {told}; {remedy}, then check again."


def unpaired(problem: str, remedy: str) -> str:
    """A camera whose pictures belong to no frame of the others."""
    return f"{problem[0].upper()}{problem[1:]}; {remedy}, then check again."


def alone(cameras: tuple[str, ...]) -> str:
    """Cameras that see nothing that another sees at the same time."""
    see = "sees" if len(cameras) == 1 else "see"
    return (
        f"Nothing can be said of {joined(cameras)}, which {see} hardly a target of a carrier that "
        "another camera sees at the same time: give pictures of one instant one name, and show "
        "the targets to two cameras at once."
    )


def blurred(camera: str, now_px: float, before_px: float) -> str:
    """A camera is out of focus."""
    return (
        f"The pictures of camera {camera} are out of focus: edges are blurred by "
        f"{pixels(now_px)}, by {pixels(before_px)} in the reference. Focus it, clean its lens, "
        "and calibrate anew; nothing else can be said of it."
    )


def partly_blurred(camera: str, share: float) -> str:
    """Part of a camera's picture is soft."""
    return (
        f"A part of the pictures of camera {camera} is soft ({share:.0%} of its targets): clean "
        "its lens, then check again."
    )


def lost(camera: str, share: float) -> str:
    """A camera sees far fewer targets than it should."""
    return (
        f"Camera {camera} sees {share:.0%} of the targets that it should, going by the other "
        "cameras: look for dirt on its lens, its light, and what stands in its view."
    )


def turned(camera: str, degrees: int) -> str:
    """The whole picture is turned."""
    return (
        f"The images of camera {camera} are turned by {degrees} degrees against the reference: "
        "turn the camera or its pictures back, then check again."
    )


def on_its_side(camera: str, now_px: tuple[int, int], before_px: tuple[int, int]) -> str:
    """Pictures whose sides are swapped."""
    return (
        f"The images of camera {camera} are turned by 90 degrees against the reference "
        f"({_size(now_px)} px, not {_size(before_px)}): turn the camera or its pictures back, "
        "then check again."
    )


def other_size(camera: str, now_px: tuple[int, int], before_px: tuple[int, int]) -> str:
    """Pictures of another size."""
    return (
        f"The images of camera {camera} have {_size(now_px)} px, in the reference "
        f"{_size(before_px)}, {why_of_size(now_px, before_px)}: set the camera as before, then "
        "check again."
    )


def why_of_size(now_px: tuple[int, int], before_px: tuple[int, int]) -> str:
    """What makes pictures of another size: one factor of both sides, or a cut."""
    across, down = (now / before for now, before in zip(now_px, before_px, strict=True))
    # A scaled side is rounded to whole pixels, down or up.
    if abs(across / down - 1.0) <= 1.0 / min(now_px):
        return f"as by binning or scaling by {across:.3g}"
    return "as by another crop"


def _size(px: tuple[int, int]) -> str:
    return f"{px[0]} x {px[1]}"


def mirrored(camera: str) -> str:
    """The whole picture is mirrored."""
    return (
        f"The images of camera {camera} are mirrored against the reference: switch mirroring off, "
        "then check again."
    )


def out_of_step(camera: str, frames: int) -> str:
    """A camera's pictures belong to other frames."""
    return (
        f"The pictures of camera {camera} are {_frames_away(frames)}: pair them with the frames "
        "they belong to, then check again."
    )


def _frames_away(frames: int) -> str:
    when = "late" if frames > 0 else "early"
    count = "one frame" if abs(frames) == 1 else f"{abs(frames)} frames"
    return f"{count} {when}"


def reversed_frames(camera: str, frames: int | None = None) -> str:
    """A camera's pictures are in the opposite order, or it may be as many ``frames`` away."""
    if frames is not None:
        return (
            f"The pictures of camera {camera} are in the opposite order to those of the others, or "
            f"{_frames_away(frames)}, which too few frames show: pair them with the frames they "
            "belong to, then check again."
        )
    return (
        f"The pictures of camera {camera} are in the opposite order to those of the others: sort "
        "them, then check again."
    )


def mixed_frames(camera: str, pairs: list[tuple[str, str]]) -> str:
    """A camera's pictures are in no order that is known; ``pairs``: its frame, the others'."""
    told = ", ".join(f"{own} is {other} of the others" for own, other in pairs[:3])
    more = f" and {len(pairs) - 3} more" if len(pairs) > 3 else ""
    return (
        f"The pictures of camera {camera} are in another order than those of the others ({told}"
        f"{more}): pair them with the frames they belong to, then check again."
    )


def cropped(camera: str, shift_px: tuple[float, float], mm: float) -> str:
    """The picture is cut out of the sensor elsewhere."""
    x, y = shift_px
    return (
        f"The images of camera {camera} are shifted by ({x:+.1f}, {y:+.1f}) px against the "
        "reference, as by another crop, binning or offset of its sensor: set it as before, or "
        f"calibrate anew. Points at the subject shift by up to {length(mm)}."
    )


def all_lenses(
    ppm: float, shift_px: tuple[float, float], mm: float, some: tuple[str, ...] = ()
) -> str:
    """All lenses changed alike, or those of ``some``, or their pictures were cut alike."""
    x, y = shift_px
    who = joined(some) if some else "all cameras"
    change = f"{ppm:+.0f} ppm" if abs(ppm) < MANY_PPM else f"{1e-4 * ppm:+.1f} %"
    effect = f"points at the subject shift by up to {length(mm)}."
    if not (x or y):
        return (
            f"The focal lengths of {who} have changed by {change}, as by temperature "
            f"or by pictures of another size: {effect} Let the rig reach its temperature, then "
            "calibrate anew."
        )
    size = f"resized by {change} and " if ppm else ""
    pictures = "their pictures" if some else "all pictures"
    return (
        f"The images of {who} are {size}shifted by ({x:+.1f}, {y:+.1f}) px against the "
        f"reference, as by another crop, binning or size of {pictures}: set it as before, or "
        f"calibrate anew; {effect}"
    )


def all_turned(degrees: int) -> str:
    """The pictures of all cameras are turned."""
    return (
        f"The images of all cameras are turned by {degrees} degrees against the reference: turn "
        "the pictures back, then check again."
    )


def all_mirrored() -> str:
    """The pictures of all cameras are mirrored."""
    return (
        "The images of all cameras are mirrored against the reference: switch mirroring off, "
        "then check again."
    )


def group(cameras: tuple[str, ...], others: tuple[str, ...], px: float, mm: float) -> str:
    """Cameras that moved as one."""
    return (
        f"Cameras {joined(cameras)} have moved together, as if on one part of the rig, or "
        f"{joined(others)} have: the images cannot tell which. Image points are off by "
        f"{pixels(px)}, which shifts points at the subject by up to {length(mm)}."
    )


def together(mm: float) -> str:
    """Several changes, each small, add up."""
    return f"Together these changes shift points at the subject by up to {length(mm)}."


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
