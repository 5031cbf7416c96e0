"""What has one place in the project stays there: projections, OpenCV. Read from the syntax."""

from __future__ import annotations

import ast
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("common", "geometry", "solver", "rig", "calibration", "evaluation", "service")

PROJECTIONS = "geometry/camera/"

TERMS = {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"}
"""The terms of distortion. Files and exports may hold them, sums may not."""

OPENCV_CAMERAS = {
    "projectPoints",
    "undistort",
    "undistortPoints",
    "undistortPointsIter",
    "undistortImagePoints",
    "initUndistortRectifyMap",
}

HOMOGRAPHIES = {
    "calibration/detection/localmap.py",
    "calibration/detection/planes.py",
    "calibration/targets/rendering.py",
    "rig/acquisition/timingboard/reading.py",
}
"""They divide by the third coordinate of a map from plane to plane, which is no camera."""

OWN_DIVISIONS = {
    "solver/constraints/rays.py",
    "solver/constraints/table.py",
}
"""Projections still to be taken from the camera model."""

OWN_TERMS: set[str] = set()
"""Distortion still to be taken from the camera model."""

OPENCV = {
    "calibration/adjustment/initialisation/resection.py",
    "calibration/detection/opencv.py",
    "evaluation/reconstruction/agreement.py",
    "evaluation/reconstruction/depthmaps.py",
    "evaluation/reconstruction/seams.py",
    "evaluation/reconstruction/stereo.py",
    "evaluation/reconstruction/texture.py",
    "evaluation/reconstruction/views.py",
    "rig/acquisition/cameras/pixels.py",
    "rig/acquisition/cameras/workers/opencv_driver.py",
    "rig/acquisition/imaging.py",
    "rig/acquisition/timingboard/reading.py",
    "rig/simulation/blender/handoff.py",
    "rig/simulation/defocus.py",
    "rig/simulation/flats.py",
    "rig/simulation/heads.py",
    "rig/simulation/imaging.py",
    "rig/simulation/pool.py",
    "rig/simulation/sampling.py",
    "rig/simulation/skin.py",
}
"""Modules that call OpenCV: readers and makers of pictures, and nothing else."""


def imports_opencv(node: ast.AST) -> bool:
    """``import cv2`` in any of its spellings."""
    if isinstance(node, ast.Import):
        return any(name.name.split(".")[0] == "cv2" for name in node.names)
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").split(".")[0] == "cv2"
    called = isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module")
    return called and "'cv2'" in ast.unparse(node)


def distorts(node: ast.AST) -> bool:
    """A product with a distortion term, a Horner polynomial in one name, or OpenCV's own."""
    if isinstance(node, ast.Attribute) and node.attr in OPENCV_CAMERAS:
        return ast.unparse(node.value).lstrip("_").startswith("cv2")
    if not isinstance(node, ast.BinOp) or not isinstance(node.op, ast.Mult):
        return False
    names = {part.id for part in (node.left, node.right) if isinstance(part, ast.Name)}
    return bool(names & TERMS) or bool(names & _multiplied_inside(node))


def _multiplied_inside(product: ast.BinOp) -> set[str]:
    """Names by which a term of a sum within ``product`` is multiplied by a sum again.

    ``r2 * (a + r2 * (b + r2 * c))`` gives r2, whatever its terms are called.
    """
    found = set()
    for side in (product.left, product.right):
        if isinstance(side, ast.BinOp) and isinstance(side.op, ast.Add):
            for term in (side.left, side.right):
                if isinstance(term, ast.BinOp) and isinstance(term.op, ast.Mult):
                    nested = any(isinstance(p, ast.BinOp) for p in (term.left, term.right))
                    names = {p.id for p in (term.left, term.right) if isinstance(p, ast.Name)}
                    found |= names if nested else set()
    return found


def divides_by_depth(node: ast.AST) -> bool:
    """The first coordinates of an array over its third: ``p[:, :2] / p[:, 2:]`` and its like."""
    if not isinstance(node, ast.BinOp) or not isinstance(node.op, ast.Div):
        return False
    above, below = node.left, node.right
    if not isinstance(above, ast.Subscript) or not isinstance(below, ast.Subscript):
        return False
    same = ast.unparse(above.value) == ast.unparse(below.value)
    last = below.slice.elts[-1] if isinstance(below.slice, ast.Tuple) else below.slice
    if isinstance(last, ast.Constant) and last.value is None and isinstance(below.slice, ast.Tuple):
        last = below.slice.elts[-2]
    return same and ast.unparse(last) in ("2", "2:", "2:3", "-1", "-1:")


RULES = (imports_opencv, distorts, divides_by_depth)


@cache
def places_of_rules(root: Path) -> dict[Callable[[ast.AST], bool], list[str]]:
    """For each rule the modules of the packages with a node that it finds, read once."""
    found: dict[Callable[[ast.AST], bool], list[str]] = {rule: [] for rule in RULES}
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
            for rule in RULES:
                if any(map(rule, nodes)):
                    found[rule].append(path.relative_to(root).as_posix())
    return found


def places(rule: Callable[[ast.AST], bool], root: Path = ROOT) -> list[str]:
    """Modules of the packages with a node that the rule finds."""
    return places_of_rules(root)[rule]


def test_opencv_is_called_in_named_modules_only() -> None:
    assert set(places(imports_opencv)) <= OPENCV


def test_distortion_stands_in_the_camera_model_only() -> None:
    found = {name for name in places(distorts) if not name.startswith(PROJECTIONS)}
    assert found <= OWN_TERMS


def test_the_camera_model_is_found_by_the_same_rules() -> None:
    assert PROJECTIONS + "distortion.py" in set(places(distorts))


def test_projection_stands_in_the_camera_model_only() -> None:
    found = {name for name in places(divides_by_depth) if not name.startswith(PROJECTIONS)}
    assert found <= HOMOGRAPHIES | OWN_DIVISIONS


@pytest.mark.parametrize(
    ("rule", "breach"),
    [
        (imports_opencv, "import cv2.aruco as a"),
        (imports_opencv, "def late():\n    from cv2 import imread"),
        (imports_opencv, "tool = importlib.import_module('cv2')"),
        (distorts, "x = x * (1 + k1 * r2)"),
        (distorts, "scale = 1 + q * (a + q * (b + q * c))"),
        (distorts, "scale = 1 + ((c * q + b) * q + a) * q"),
        (distorts, "pixels = _cv2.projectPoints(p, r, t, k, d)"),
        (divides_by_depth, "n = p[:, :2] / p[:, 2:]"),
        (divides_by_depth, "n = p[..., :2] / p[..., 2, None]"),
        (divides_by_depth, "n = p[0] / p[2]"),
        (divides_by_depth, "n = local[:, 0] / local[:, 2]"),
    ],
)
def test_a_breach_would_be_found(
    rule: Callable[[ast.AST], bool], breach: str, tmp_path: Path
) -> None:
    (tmp_path / "solver").mkdir()
    (tmp_path / "solver" / "planted.py").write_text(breach, encoding="utf-8")
    assert places(rule, tmp_path) == ["solver/planted.py"]


@pytest.mark.parametrize("rule", RULES)
def test_what_is_no_breach_is_let_be(rule: Callable[[ast.AST], bool], tmp_path: Path) -> None:
    (tmp_path / "rig").mkdir()
    text = "k1, k2 = camera.distortion[:2]\nterms = [k1, k2]\nshare = size[0] / size[1]\n"
    (tmp_path / "rig" / "plain.py").write_text(text, encoding="utf-8")
    assert not places(rule, tmp_path)
