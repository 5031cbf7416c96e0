"""Design files: what is written is complete, what is read is exact."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.scan import Scan, ScanNote
from rig.design.designfile import (
    design_document,
    design_from_mapping,
    evaluation_document,
    placed_camera,
    read_design,
)
from rig.design.designmodel import DesignFile
from rig.specification.examples import example_rig
from solver.result import Design, Relaxation

EXISTING: dict[str, Any] = {
    "schema": "rigwright.design/1",
    "cameras": [
        {
            "name": "left",
            "position_mm": [-200.0, -700.0, 0.0],
            "omega_phi_kappa_deg": [90.0, -16.0, 0.0],
            "image_size_px": [4000, 2667],
            "camera_matrix": [[8665.5, 0.0, 1999.5], [0.0, 8665.5, 1333.0], [0.0, 0.0, 1.0]],
            "distortion": [0.0, 0.0, 0.0, 0.0, 0.0],
            "focus_distance_mm": 728.0,
        }
    ],
}


def full_document(design: Design) -> dict[str, Any]:
    scan = Scan(
        np.array([[0.0, 0, 0], [100, 0, 0], [0, 0, 230]]),
        np.array([[0, 1, 2]]),
        np.array([[0.0, -1, 0]] * 3),
        (ScanNote("inferred", "units: mm"),),
    )
    return design_document(design, spec=example_rig("face"), scan=scan, scan_name="head.glb")


def same_camera(one: RigCamera, other: RigCamera) -> bool:
    a, b = one.camera, other.camera
    arrays = [
        (one.pose.position_rig_mm, other.pose.position_rig_mm),
        (one.pose.rotation_rig_to_camera, other.pose.rotation_rig_to_camera),
        (a.camera_matrix, b.camera_matrix),
        (a.distortion, b.distortion),
        (a.body.size_mm, b.body.size_mm),
        (a.body.centre_camera_mm, b.body.centre_camera_mm),
        (a.body.mount_thread_camera_mm, b.body.mount_thread_camera_mm),
    ]
    plain = [
        (
            one.name,
            one.focus_distance_mm,
            one.fixed,
            a.name,
            a.image_size_px,
            a.pixel_pitch_mm,
            a.focal_length_mm,
            a.f_number,
            a.circle_of_confusion_mm,
            a.min_focus_distance_mm,
            a.focus_distance_mm,
            a.body.lens_diameter_mm,
            a.body.lens_length_mm,
        )
        for one, a in ((one, a), (other, b))
    ]
    return all(np.array_equal(x, y) for x, y in arrays) and plain[0] == plain[1]


def test_a_written_document_holds_every_key(design: Design) -> None:
    document = full_document(design)
    assert set(document) == {info.alias or name for name, info in DesignFile.model_fields.items()}
    camera = document["cameras"][0]
    for key in (
        "name",
        "position_mm",
        "rotation_rig_to_camera",
        "omega_phi_kappa_deg",
        "image_size_px",
        "camera_matrix",
        "distortion",
    ):
        assert camera[key] is not None
    for key in ("name", "value", "limit", "slack", "active", "satisfied"):
        assert key in document["constraints"][0]
    points = document["points"]
    assert (
        len(points["covariance_mm2"]) == len(design.quality.points.points) == len(points["views"])
    )
    assert document["scan"]["notes"] == [{"kind": "inferred", "text": "units: mm"}]


def test_cameras_come_back_to_the_last_bit(design: Design, tmp_path: Path) -> None:
    path = tmp_path / "design.json"
    path.write_text(json.dumps(full_document(design), allow_nan=False))
    read = read_design(path)
    assert read.name == example_rig("face").name
    assert len(read.cameras) == 7
    assert all(same_camera(a, b) for a, b in zip(read.cameras, design.cameras, strict=True))
    assert read.file.rig is not None
    assert read.file.rig.to_spec().limits.base_height == example_rig("face").limits.base_height


numbers = st.floats(-1e5, 1e5, allow_nan=False)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(numbers, numbers, numbers),
    st.tuples(*[st.floats(-180, 180)] * 3),
    st.floats(350, 5000),
)
def test_any_pose_comes_back_to_the_last_bit(
    place: tuple[float, ...], angles: tuple[float, ...], focus: float
) -> None:
    camera = example_rig("face").camera
    pose = Pose.from_omega_phi_kappa(np.array(place), np.array(angles))
    one = RigCamera("cam 1", camera, pose, focus)
    text = json.dumps({"schema": "rigwright.design/1", "cameras": [placed_camera(one)]})
    assert same_camera(design_from_mapping(json.loads(text)).cameras[0], one)


def test_numbers_without_a_value_are_null(design: Design) -> None:
    quality = design.quality
    focus = quality.cameras.focus_mm.copy()
    focus[0, 1] = np.inf
    gsd = quality.cameras.gsd_mm.copy()
    gsd[0] = np.nan
    table = replace(quality.cameras, focus_mm=focus, gsd_mm=gsd)
    report = replace(
        design.solver,
        kkt_error=float("nan"),
        conflicts=(Relaxation("frame", "px", 3.0, None),),
        starts_note="nothing else was found",
    )
    odd = replace(design, quality=replace(quality, cameras=table), solver=report)
    document = json.loads(json.dumps(full_document(odd), allow_nan=False))
    first = document["quality"]["cameras"][0]
    assert first["sharp_to_mm"] is None and first["gsd_mean_mm"] is None
    assert document["solver"]["kkt_error"] is None
    assert document["solver"]["conflicts"][0]["give_alone"] is None
    assert document["solver"]["starts_note"] == "nothing else was found"
    assert len(design_from_mapping(document).cameras) == 7


def test_an_evaluation_has_the_same_figures(design: Design) -> None:
    document, full = evaluation_document(design.cameras, design.quality), full_document(design)
    assert document["schema"] == "rigwright.evaluation/1"
    for key in ("quality", "constraints", "cameras", "points", "feasible"):
        assert document[key] == full[key]


def test_an_existing_rig_needs_little() -> None:
    default = example_rig("face").camera
    (camera,) = design_from_mapping(EXISTING, "old.json", default).cameras
    assert camera.camera.body is default.body
    assert camera.camera.focal_length_px == pytest.approx(8665.5)
    assert np.allclose(camera.pose.omega_phi_kappa_deg, [90.0, -16.0, 0.0])
    with pytest.raises(
        InputError, match="does not say its lens and body; add it or give a rig file"
    ):
        design_from_mapping(EXISTING, "old.json")


def changed(**values: object) -> dict[str, Any]:
    document = copy.deepcopy(EXISTING)
    document["cameras"][0].update(values)
    return document


BAD = {
    "unknown key": (
        changed(positon_mm=[0, 0, 0]),
        "cameras[0].positon_mm is not known; did you mean position_mm?",
    ),
    "no camera": ({"schema": "rigwright.design/1", "cameras": []}, "cameras is []"),
    "other version": (
        {**EXISTING, "schema": "rigwright.design/2"},
        "schema is 'rigwright.design/2'",
    ),
    "a list": ([1, 2], "the file is [1, 2]"),
    "two orientations that differ": (
        changed(rotation_rig_to_camera=[[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
        "contradict each other",
    ),
    "no orientation": (changed(omega_phi_kappa_deg=None), "has no orientation"),
    "no rotation": (
        changed(rotation_rig_to_camera=[[1, 0, 0], [0, 1, 0], [0, 0, 2]]),
        "is not a rotation",
    ),
    "oblong pixels": (
        changed(camera_matrix=[[8665.5, 0, 1999.5], [0, 8000.0, 1333.0], [0, 0, 1]]),
        "square pixels",
    ),
    "no focal length": (
        changed(camera_matrix=[[0, 0, 0], [0, 0, 0], [0, 0, 1]]),
        "no positive focal length",
    ),
    "no focus": (changed(focus_distance_mm=None), "has no focus_distance_mm"),
    "nan": (changed(position_mm=[float("nan"), 0, 0]), "finite"),
    "same name": (
        {**EXISTING, "cameras": EXISTING["cameras"] * 2},
        "two cameras are called 'left'",
    ),
    "markup for a name": (changed(name="<script>"), "cameras[0].name is '<script>'"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_design_files_get_one_line(name: str) -> None:
    document, expected = BAD[name]
    with pytest.raises(InputError) as caught:
        design_from_mapping(document, "d.json", example_rig("face").camera)
    assert expected in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_are_no_design_files(tmp_path: Path) -> None:
    for name, content in {"a.json": b"{", "b.json": b"\xff\xfe", "c.json": b"[" * 200_000}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=f"{name} is not JSON"):
            read_design(tmp_path / name)
    with pytest.raises(InputError, match="no such file"):
        read_design(tmp_path / "none.json")


def test_the_rig_in_the_document_is_a_design_file(repo: Path) -> None:
    text = (repo / "docs/reference/design-file.md").read_text(encoding="utf-8")
    data = json.loads(text.split("```json\n")[1].split("```")[0])
    assert design_from_mapping(data, "doc", example_rig("face").camera).cameras[0].name == "left"
