"""OpenCV is called in two modules of calibration only, where its majors are made alike."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ALLOWED = {
    "calibration/adjustment/initialisation/resection.py",
    "calibration/detection/opencv.py",
}


def imports(text: str) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.split(".")[0])
    return found


def test_only_the_named_modules_call_opencv() -> None:
    assert "cv2" in imports("def late() -> None:\n    import cv2\n")
    files = (ROOT / "calibration").rglob("*.py")
    callers = {p.relative_to(ROOT).as_posix() for p in files if "cv2" in imports(p.read_text())}
    assert callers == ALLOWED
