"""What each kind of limit means, in plain words."""

from __future__ import annotations

FAMILIES: dict[str, tuple[str, str]] = {
    "bound": ("Bounds", "How far a camera may move or turn from its start (Eq 8)."),
    "base_height": (
        "Base/height",
        "Distance of two cameras over their distance to the subject (Eq 9).",
    ),
    "incidence": (
        "Incidence",
        "Angle between the surface's normal and the way to the camera (Eq 10).",
    ),
    "frame": ("In frame", "Every seen point lies inside the image (Eq 11)."),
    "centring": ("Centred image", "The seen points are centred in the image (Eq 12)."),
    "roll": ("Roll", "Pictures stand level, or upright on their side."),
    "spacing": ("Spacing", "Mean distance of neighbouring cameras (Eq 13)."),
    "symmetry": ("Symmetry", "Camera positions are symmetric about the subject (Eqs 14, 15)."),
    "coverage": ("Coverage", "Share of the region that enough cameras see."),
    "matchable": ("Matchable", "Share of what can be matched that enough pairs of cameras can."),
    "groups": ("Groups", "Cameras hang together by the surface that they can match."),
    "depth_of_field": ("Sharpness", "Every seen point lies within the depth of field."),
    "min_focus": ("Nearest focus", "No seen point is nearer than the lens can focus."),
    "gsd": ("Pixel size", "Size of a pixel on the subject."),
    "stand_off": ("Stand-off", "Distance of a camera from the subject's centroid."),
    "body_clearance": ("Bodies", "Gap between two camera bodies."),
    "sight_line": ("Free view", "Gap between a body and another camera's view."),
    "zone_allowed": ("Allowed zone", "Room to the border of the zone a camera must stay in."),
    "zone_forbidden": ("Forbidden zone", "Gap to a zone where no camera may stand."),
}

ENDS = {
    "min": "least",
    "max": "greatest",
    "mean min": "least mean",
    "mean max": "greatest mean",
    "neighbour": "nearest neighbour",
}


def family_words(family: str) -> tuple[str, str]:
    """Title and explanation of a family such as ``base_height_min``; or the family itself."""
    known = [key for key in FAMILIES if family == key or family.startswith(key + "_")]
    if not known:
        return family.replace("_", " "), ""
    key = max(known, key=len)
    title, words = FAMILIES[key]
    rest = family[len(key) :].strip("_").replace("_", " ")
    counted = "pairs" if key == "matchable" else "views"
    rest = f"{rest} or more {counted}" if rest.isdigit() else ENDS.get(rest, rest)
    return f"{title}, {rest}" if rest else title, words
