"""A request of each kind, for the OpenAPI document: each fits its schema, a test holds that."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from rig.specification.examples import example_text

_STUDY = """\
schema = "rigwright.study/1"
rigs = ["face.toml"]
heads = ["head.ply"]

[grid]
cameras = [4, 5, 6]
"""
_SCAN = "5c0e6f2a"
_DESIGN = "9b2d41c7"
_TARGETS = "77ab90d3"
_CALIBRATION = "e55f1b08"
_RECONSTRUCTION = "0d41f77e"


def body_examples() -> Mapping[str, Any]:
    """By operation id. The ids in them stand for those that the service has given."""
    rig = tomllib.loads(example_text("face"))
    design = json.loads(_practice("design.json"))
    network = {"schema": design["schema"], "cameras": design["cameras"][:2]}
    # The plate alone fits on a sheet of A4.
    targets = tomllib.loads(_practice("targets.toml"))
    pictures = {"session": "monday"}
    return {
        "add_design": {"scan_id": _SCAN, "rig": rig, "cameras": 7},
        "add_study": {
            "study": {"name": "How many?", "starts": 2, "grid": {"cameras": [4, 5, 6]}},
            "rigs": [rig],
            "scan_ids": [_SCAN],
        },
        "read_study_files": {
            "study": {"name": "study.toml", "text": _STUDY},
            "rigs": [{"name": "face.toml", "text": example_text("face")}],
        },
        "add_evaluation": {"scan_id": _SCAN, "rig": rig, "design": network},
        "add_plan": {"design_id": _DESIGN, "mount": {"kind": "t-slot"}},
        "add_target_set": {key: targets[key] for key in ("schema", "name", "plates")},
        "add_target_file": {"name": "targets.toml", "text": _practice("targets.toml")},
        "propose_target_set": {"design_id": _DESIGN},
        "add_calibration": {
            "target_set_id": _TARGETS,
            "pictures": pictures,
            "design_id": _DESIGN,
        },
        "add_check": {"calibration_id": _CALIBRATION, "pictures": {"session": "tuesday"}},
        "add_acceptance": {
            "calibration_id": _CALIBRATION,
            "target_set_id": _TARGETS,
            "pictures": pictures,
        },
        "add_reconstruction": {
            "calibration_id": _CALIBRATION,
            "pictures": {"session": "anna", "captures": ["anna-001"]},
        },
        "add_comparison": {
            "cloud": {"reconstruction_id": _RECONSTRUCTION},
            "reference_scan_id": _SCAN,
        },
        "add_capture": {"capture_id": "anna-001", "session": "anna"},
        "add_rig_test": {"test": "self-test"},
        "reject_pictures": {"camera": "cam03", "shot": 1, "why": "blinked"},
        "accept_pictures": {"camera": "cam03", "shot": 1},
        "sign_in": {"key": "rw_what-keys-add-showed"},
    }


def _practice(name: str) -> str:
    return files("service.practice").joinpath(name).read_text(encoding="utf-8")
