"""Reads poses, settings and holes back from finished drawings, as a person or a program would.

Nothing here uses the code that draws: only the files, the words on them, and the frames.
"""

from __future__ import annotations

import io
import itertools
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import ezdxf
import numpy as np
import pypdfium2
from ezdxf.document import Drawing

POINTS_PER_MM = 72.0 / 25.4
FIGURE = r"-?\d+\.\d+"
POSE_ROW = re.compile(r"^(\S*[A-Za-z]\S*)" + 6 * rf" ({FIGURE})" + rf" {FIGURE}$")
SETTING_ROW = re.compile(r"^(.+?) (-?\d+(?:\.\d+)?) (mm|deg) (?:as made|[\d.]+) ")
SVG = "{http://www.w3.org/2000/svg}"


@dataclass(frozen=True)
class ReadPose:
    """Optical centre from the datum (3,), and pan, tilt, roll (3,)."""

    from_datum_mm: np.ndarray
    pan_tilt_roll_deg: np.ndarray


def rotation_rig_to_camera(pan_tilt_roll_deg: np.ndarray) -> np.ndarray:
    """Worked out anew: a camera that looks along +Y, panned right, tilted up, rolled clockwise."""
    pan, tilt, roll = np.radians(pan_tilt_roll_deg)
    forward = np.array([np.sin(pan) * np.cos(tilt), np.cos(pan) * np.cos(tilt), np.sin(tilt)])
    level = np.array([np.cos(pan), -np.sin(pan), 0.0])
    down = np.cross(forward, level)
    # Clockwise seen from behind: the image's right side goes down.
    right = np.cos(roll) * level + np.sin(roll) * down
    return np.array([right, np.cross(forward, right), forward])


def angle_between_deg(one: np.ndarray, other: np.ndarray) -> float:
    """Angle of the rotation from one (3, 3) to another."""
    off = np.linalg.norm(one - other) / np.sqrt(8.0)
    return float(np.degrees(2.0 * np.arcsin(np.clip(off, 0.0, 1.0))))


def poses_in(lines: list[str]) -> dict[str, ReadPose]:
    """Rows of the cameras' table among lines of text."""
    found = {}
    for line in lines:
        row = POSE_ROW.match(line)
        if row:
            figures = np.array([float(v) for v in row.groups()[1:]])
            found[row[1]] = ReadPose(figures[:3], figures[3:])
    return found


def settings_in(lines: list[str]) -> dict[str, float]:
    """Rows of a setting sheet's table among lines of text."""
    rows = (SETTING_ROW.match(line) for line in lines)
    return {row[1]: float(row[2]) for row in rows if row}


CHAIN_ROW = re.compile(r"^#(\d+)" + 6 * r" (-?\d+\.\d+)" + r" (.+)$")
MOTION = re.compile(r"^(slide|turn) (\S+|\(.*\)) by (.+?)(?: x (-?\d+\.\d+))?$")


def chain_pose(lines: list[str], values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Optical centre from the datum (3,) and rotation_rig_to_camera (3, 3), from a sheet alone.

    Goes along the rows of the chain as their heading says, with the settings of the same sheet.
    """
    at = np.eye(4)
    rows = {int(m[1]): m for m in map(CHAIN_ROW.match, lines) if m}
    for number in range(1, len(rows) + 1):
        row = rows[number]
        x, y, z, first, second, third = (float(row[k]) for k in range(2, 8))
        step = np.eye(4)
        step[:3, 3] = x, y, z
        step[:3, :3] = about("z", first) @ about("x", second) @ about("y", third)
        at = at @ step
        motion = MOTION.match(row[8])
        if motion is None:
            continue
        value = values[motion[3]] * float(motion[4] or 1.0)
        sign, axis = (-1.0 if motion[2][0] == "-" else 1.0), motion[2][-1]
        moved = np.eye(4)
        if motion[1] == "slide":
            moved[:3, 3] = sign * value * np.eye(3)["xyz".index(axis)]
        else:
            moved[:3, :3] = about(axis, sign * value)
        at = at @ moved
    return at[:3, 3], at[:3, :3].T


def about(axis: str, angle_deg: float) -> np.ndarray:
    """Right-handed rotation about a coordinate axis, written down."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def pdf_lines(pdf: bytes) -> list[list[str]]:
    """Lines of text per page."""
    document = pypdfium2.PdfDocument(pdf)
    return [page.get_textpage().get_text_range().splitlines() for page in document]


def svg_lines(svg: bytes) -> list[list[str]]:
    """Lines of text per sheet: texts at one height, from left to right."""
    root = ET.fromstring(svg)  # noqa: S314 -- made by the test itself
    return [
        _rows(
            [(*_translate(t.attrib["transform"]), t.text or "") for t in group.iter(f"{SVG}text")]
        )
        for group in root.findall(f"{SVG}g")
    ]


def _translate(transform: str) -> tuple[float, float]:
    x, y = re.findall(r"translate\((\S+) (\S+)\)", transform)[0]
    return float(x), float(y)


def read_dxf(dxf: bytes) -> Drawing:
    return ezdxf.read(io.StringIO(dxf.decode("utf-8")))


def dxf_lines(document: Drawing) -> list[str]:
    """Lines of text in model space, sheet by sheet: texts at one height, from left to right."""
    space = document.modelspace()
    boxes = [np.array(e.get_points("xy")) for e in space.query('LWPOLYLINE[layer=="FRAME"]')]
    tallest = max(float(np.ptp(box[:, 1])) for box in boxes)
    frames = sorted(
        (b[:, 0].min(), b[:, 0].max()) for b in boxes if np.ptp(b[:, 1]) > tallest / 100.0
    )
    lines = []
    for left, right in frames:
        texts = []
        for text in space.query("TEXT"):
            _, place, end = text.get_placement()
            at = end if end is not None and text.dxf.halign else place
            if left < at.x < right:
                texts.append((at.x, at.y, text.dxf.text))
        lines += _rows(texts)
    return lines


def _rows(texts: list[tuple[float, float, str]]) -> list[str]:
    """Texts that follow one another at one height: tables beside each other are drawn in turn."""
    return [
        " ".join(words for _, _, words in sorted(row))
        for _, row in itertools.groupby(texts, lambda text: round(text[1], 2))
    ]


def dxf_geometry(document: Drawing) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Optical centre from the datum and optical axis of each camera, measured in the views.

    The three views are told apart by the crosses at the datum: top is above front, side right
    of it. X and Z come from the front view, Y from the top view; Z again from the side. Seen from
    the subject's side, which the front's title says, X and Y count the other way.
    """
    space = document.modelspace()
    before = any("from the subject's side" in line for line in dxf_lines(document))
    sign = np.array([-1.0, -1.0, 1.0] if before else [1.0, 1.0, 1.0])
    crosses = [
        np.array(e.get_points("xy")).mean(axis=0) for e in space.query('LWPOLYLINE[layer=="DATUM"]')
    ]
    centres = np.unique(np.round(crosses, 6), axis=0)
    assert len(centres) == 3
    front = min(centres, key=lambda c: c[0] + c[1])
    top = max(centres, key=lambda c: c[1])
    side = max(centres, key=lambda c: c[0])
    axes = [np.array(e.get_points("xy")) for e in space.query('LWPOLYLINE[layer=="AXIS"]')]
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for block in space.query("INSERT"):
        at = np.array(block.dxf.insert)[:2]
        name = block.get_attrib("NAME").dxf.text
        end = next(a[1] for a in axes if np.allclose(a[0], at, atol=1e-6))
        found.setdefault(name, []).append((at, end))
    out = {}
    for name, views in found.items():
        assert len(views) == 3
        points = []
        for end in (0, 1):
            (x, z), y = views[0][end] - front, (views[1][end] - top)[1]
            assert np.allclose(views[2][end] - side, [y, z], atol=1e-6), "the views agree"
            assert np.isclose((views[1][end] - top)[0], x, atol=1e-6)
            points.append(sign * np.array([x, y, z]))
        axis = points[1] - points[0]
        out[name] = points[0], axis / np.linalg.norm(axis)
    return out


def dxf_attributes(document: Drawing) -> list[str]:
    """A line of text per camera block: its name and figures."""
    tags = ("NAME", "X", "Y", "Z", "PAN", "TILT", "ROLL", "FOCUS")
    blocks = document.modelspace().query("INSERT")
    return [" ".join(block.get_attrib(tag).dxf.text for tag in tags) for block in blocks]


def dxf_holes(document: Drawing) -> np.ndarray:
    """Holes (N, 3) of a template: x and y from the lower left of the outline, and diameter."""
    space = document.modelspace()
    outline = next(iter(space.query('LWPOLYLINE[layer=="OUTLINE"]')))
    corner = np.array(outline.get_points("xy")).min(axis=0)
    circles = space.query('CIRCLE[layer=="VISIBLE"]')
    return np.array([[*(np.array(c.dxf.center)[:2] - corner), 2.0 * c.dxf.radius] for c in circles])


def svg_holes(svg: bytes) -> np.ndarray:
    """The same from an SVG in true size."""
    root = ET.fromstring(svg)  # noqa: S314 -- made by the test itself
    outline = next(e for e in root.iter(f"{SVG}polygon") if e.attrib["class"] == "outline")
    points = np.array([[float(v) for v in p.split(",")] for p in outline.attrib["points"].split()])
    circles = [e.attrib for e in root.iter(f"{SVG}circle") if e.attrib["class"] == "visible"]
    return np.array(
        [
            [
                *(np.array([float(c["cx"]), float(c["cy"])]) - points.min(axis=0)),
                2.0 * float(c["r"]),
            ]
            for c in circles
        ]
    )


def pdf_holes(pdf: bytes, diameter_mm: float) -> list[np.ndarray]:
    """Per page of a tiled template its holes (N, 2) of a diameter, from the plate's lower left.

    A page says where its window begins; its window is the largest rectangle on it.
    """
    out = []
    for page in pypdfium2.PdfDocument(pdf):
        words = page.get_textpage().get_text_range()
        start = re.search(rf"window from X ({FIGURE}), Y ({FIGURE})", words)
        assert start is not None
        shapes = [o for o in page.get_objects() if o.type == pypdfium2.raw.FPDF_PAGEOBJ_PATH]
        bounds = np.array([shape.get_bounds() for shape in shapes]) / POINTS_PER_MM
        sizes = bounds[:, 2:] - bounds[:, :2]
        corner = bounds[sizes.prod(axis=1).argmax(), :2]
        # Bounds include the line, twice 0.3 mm at most.
        holes = (np.abs(sizes - diameter_mm) < 0.7).all(axis=1)
        middles = (bounds[holes, :2] + bounds[holes, 2:]) / 2.0
        out.append(middles - corner + np.array([float(start[1]), float(start[2])]))
    return out
