"""Names of quantities end in their unit, in the domain packages. Read from the syntax.

Files and requests keep the keys that they always had; those stand in pydantic models, which are
left out. So are private functions: their callers are in sight.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("geometry", "solver", "rig", "calibration", "evaluation")

QUANTITIES = {
    *("distance", "width", "height", "depth", "radius", "diameter", "thickness", "length"),
    *("angle", "azimuth", "elevation", "tilt", "pan", "roll", "focal", "exposure", "delay"),
    *("timeout", "deadline", "duration", "lag", "latency", "interval", "period", "jitter"),
    *("offset", "gap", "margin", "clearance", "spacing", "pitch", "altitude", "standoff"),
}
UNITS = {
    *("mm", "mm2", "mm3", "um", "rad", "deg", "px", "us", "s", "ms", "ns", "utc", "hz"),
    *("ticks", "share", "ratio", "samples", "squares", "bytes"),
}
NUMBERS = re.compile(r"^(float|int|Floats|tuple\[(float|int)\b)")

DIMENSIONLESS = {
    "rig.acquisition.session.naming.BOX_ID_LENGTH": "characters",
    "rig.acquisition.trigger.faultscript.FaultRates.delay": "a probability",
    "rig.build.parts.masses.PITCH_DEPTH": "in pitches",
    "rig.build.parts.masses.SOCKET_DEPTH": "in diameters",
    "rig.build.wedges.engraving.LINE_PITCH": "in heights of a capital",
    "rig.build.wedges.lettering.Words.width": "in heights of a capital",
    "rig.report.surface.REACH_IN_SPACINGS": "so many",
    "rig.simulation.sensor.developed.exposure": "relative to the reference",
    "calibration.acceptance.lines.LEAST_LENGTHS": "how many",
    "calibration.check.scores.Outcomes.margin": "of a test's statistic",
    "calibration.detection.opencv.components.offset": "grey levels",
    "calibration.targets.ringcodes.RingCodeFamily.distance": "Hamming's",
    "solver.constraints.base.camera_columns.width": "columns",
    "solver.result.Quality.base_height": "a quotient; a key of design files too",
    "solver.starts._JITTER_DISTANCE": "a share of the distance",
    "solver.starts.kmeans_start.jitter": "a share of how far starts are moved about",
}
"""What has no unit, and why."""

SCALED = ("solver.nlp.", "solver.constraints.", "solver.outer_loop.", "solver.refinement.")
"""They count in the scaled variables of the nonlinear program, which have no unit."""

SCALED_WORDS = frozenset(("radius", "offset", "focal", "depth", "length", "width"))


def names_a_quantity(name: str) -> bool:
    """Whether a name is that of a quantity without its unit."""
    words = name.lower().strip("_").split("_")
    if UNITS & set(words):
        return False
    return words[-1] in QUANTITIES or words[-1].removesuffix("s") in QUANTITIES


def quantities(module: str, tree: ast.Module) -> Iterator[str]:
    """Full names of the quantities of a module that lack their unit."""
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            yield from _constants(module, node)
        if isinstance(node, ast.ClassDef) and not _is_a_model(node):
            yield from _fields(f"{module}.{node.name}", node)
            for inner in node.body:
                yield from _parameters(f"{module}.{node.name}", inner)
        yield from _parameters(module, node)


def _is_a_model(node: ast.ClassDef) -> bool:
    return any(re.search(r"Model|Section|Request|Result", ast.unparse(base)) for base in node.bases)


def _constants(module: str, node: ast.Assign | ast.AnnAssign) -> Iterator[str]:
    value = node.value
    number = isinstance(value, ast.Constant) and isinstance(value.value, int | float)
    for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
        if number and isinstance(target, ast.Name) and names_a_quantity(target.id):
            yield f"{module}.{target.id}"


def _fields(owner: str, node: ast.ClassDef) -> Iterator[str]:
    for field in node.body:
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            number = NUMBERS.match(ast.unparse(field.annotation))
            if number and names_a_quantity(field.target.id):
                yield f"{owner}.{field.target.id}"


def _parameters(owner: str, node: ast.stmt) -> Iterator[str]:
    if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
        return
    for given in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
        number = given.annotation and NUMBERS.match(ast.unparse(given.annotation))
        if number and names_a_quantity(given.arg):
            yield f"{owner}.{node.name}.{given.arg}"


@cache
def found(root: Path) -> set[str]:
    """Every quantity of the domain packages that lacks its unit."""
    out = set()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            module = ".".join(path.relative_to(root).with_suffix("").parts)
            out |= set(quantities(module, ast.parse(path.read_text(encoding="utf-8"))))
    return out


def _is_scaled(name: str) -> bool:
    words = name.rsplit(".", 1)[1].lower().split("_")
    return name.startswith(SCALED) and words[-1] in SCALED_WORDS


def test_names_of_quantities_end_in_their_unit() -> None:
    left = {name for name in found(ROOT) - set(DIMENSIONLESS) if not _is_scaled(name)}
    assert left == set(), "give the name its unit, or say in DIMENSIONLESS why it has none"


def test_what_is_excused_is_there() -> None:
    assert set(DIMENSIONLESS) <= found(ROOT)


@pytest.mark.parametrize(
    ("breach", "name"),
    [
        ("LONGEST_DELAY = 5.0\n", "LONGEST_DELAY"),
        ("_TIMEOUT: float = 5\n", "_TIMEOUT"),
        ("class Body:\n    radius: float\n", "Body.radius"),
        ("class Body:\n    widths: Floats | None\n", "Body.widths"),
        ("class Body:\n    def move(self, lens_distance: float) -> None: ...\n",
         "Body.move.lens_distance"),
        ("def aim(camera: int, *, tilt: float = 0.0) -> None: ...\n", "aim.tilt"),
    ],
)  # fmt: skip
def test_a_planted_breach_is_found(breach: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / "planted.py").write_text(breach, encoding="utf-8")
    assert found(tmp_path) == {f"rig.planted.{name}"}


@pytest.mark.parametrize(
    "fine",
    [
        "LONGEST_DELAY_US = 5.0\nNAMES_LENGTH = len('x')\n",
        "class Body:\n    radius_mm: float\n    views: int\n    width: str\n",
        "class Keys(StrictModel):\n    radius: float\n",
        "def _near(radius: float) -> None: ...\ndef far(radius_mm: float) -> None: ...\n",
    ],
)
def test_what_is_no_breach_is_let_be(fine: str, tmp_path: Path) -> None:
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / "planted.py").write_text(fine, encoding="utf-8")
    assert found(tmp_path) == set()
