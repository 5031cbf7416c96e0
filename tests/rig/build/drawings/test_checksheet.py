"""Each way of checking a camera sees 0.3 degrees and 1 mm, from the sheet's figures alone."""

from __future__ import annotations

import csv
import io

import numpy as np
import plan_readers as read_sheet
import pytest
from plans import plate_plan, tslot_plan
from sheet_plans import KINDS, plan

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.drawings import check_sheets, checks_csv, pdf_bytes
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.settings import turn
from rig.build.mounts.solids import lens_front
from rig.build.mounts.verifying import ENDS, FLOOR_MARKS

READ_PX = 0.5
"""The tip of a mark is found in a picture at twice its size to half a pixel."""

READ_MM = 0.5
"""A tape in millimetres is read to half of one."""

READ_DEG = 0.1
"""What a digital inclinometer for a workshop states."""


def rows(made: MountPlan) -> dict[str, dict[str, str]]:
    return {row["camera"]: row for row in csv.DictReader(io.StringIO(checks_csv(made)))}


def figures(row: dict[str, str], fields: list[str]) -> np.ndarray:
    return np.array([float(row[f].replace("–", "nan")) for f in fields])


PIXELS = [f"{mark}_{axis}_px" for mark in ("datum", "over", "left") for axis in "xy"]
TAPES = [f"{start}_to_{end}_mm" for start in ("datum", "floor") for end in ENDS]
TAPES.append("second_to_middle_mm")
LEANS = ["axis_up_deg", "width_right_up_deg", "height_top_up_deg"]


def seen(camera: RigCamera, made: MountPlan, row: dict[str, str]) -> dict[str, np.ndarray]:
    """The same figures by plain trigonometry, of a camera that may stand wrong."""
    far, datum = float(row["mark_mm"]), made.datum_rig_mm
    marks = datum + far * np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0]])
    local = (marks - camera.pose.position_rig_mm) @ camera.pose.rotation_rig_to_camera.T
    kind = camera.camera
    assert not kind.distortion.any()
    pixels = kind.focal_length_px * local[:, :2] / local[:, 2:] + kind.principal_point_px
    x, y, z = camera.pose.rotation_rig_to_camera
    ends = lens_front(camera) + 150.0 * np.stack([x, -x, -y, y])
    low = min(s.corners_mm[:, 2].min() for s in made.structure.solids)
    plumb = np.array([datum[0], datum[1], low])
    floor = [plumb + 1500.0 * dict(FLOOR_MARKS)[row[f]] for f in ("floor_mark", "second_mark")]
    tapes = [np.linalg.norm(ends - start, axis=1) for start in (datum, floor[0])]
    tapes.append(np.linalg.norm(ends.mean(axis=0) - floor[1])[None])
    leans = np.degrees(np.arctan2([z[2], x[2], -y[2]], [np.hypot(*v[:2]) for v in (z, x, y)]))
    return {"pixels": pixels.ravel(), "tapes": np.concatenate(tapes), "leans": leans}


def wrong(camera: RigCamera) -> list[tuple[str, RigCamera]]:
    """The camera off by 1 mm along, or turned by 0.3 degrees about, each of its axes."""
    pose, out = camera.pose, []
    for k, axis in enumerate(np.eye(3)):
        moved = Pose(pose.position_rig_mm + pose.rotation_rig_to_camera.T @ axis,
                     pose.rotation_rig_to_camera)  # fmt: skip
        turned = Pose(pose.position_rig_mm, turn(axis, 0.3) @ pose.rotation_rig_to_camera)
        out += [(f"shift {k}", camera.moved_to(moved)), (f"turn {k}", camera.moved_to(turned))]
    return out


@pytest.mark.parametrize("kind", KINDS)
def test_the_figures_are_those_of_a_camera_that_stands_right(kind: str) -> None:
    made = plan(kind)
    for mount in made.mounts:
        row = rows(made)[mount.name]
        found = seen(mount.camera, made, row)
        # Stated to a tenth of a pixel and of a millimetre and a hundredth of a degree: half of it.
        assert np.allclose(figures(row, PIXELS), found["pixels"], atol=0.051)
        assert np.allclose(figures(row, TAPES), found["tapes"], atol=0.051)
        assert np.allclose(figures(row, LEANS), found["leans"], atol=0.0051)


@pytest.mark.parametrize("kind", KINDS)
def test_picture_and_tape_see_every_turn_and_shift_and_the_level_those_it_can(kind: str) -> None:
    made = plan(kind)
    for mount in made.mounts:
        row = rows(made)[mount.name]
        stated = [figures(row, fields) for fields in (PIXELS, TAPES, LEANS)]
        for what, camera in wrong(mount.camera):
            found = seen(camera, made, row)
            kinds = ("pixels", "tapes", "leans")
            off = [np.abs(found[k] - s).max() for k, s in zip(kinds, stated, strict=True)]
            assert off[0] > READ_PX, (mount.name, what)
            change = found["tapes"] - stated[1]
            # Of two ends the difference is read to the root of two of that.
            pairs = np.abs(change[0:8:2] - change[1:8:2]) / np.sqrt(2.0)
            assert max(off[1], pairs.max()) > READ_MM, (mount.name, what)
            if what == "turn 2":  # about the axis of a camera that looks nearly level
                assert off[2] > READ_DEG or abs(mount.camera.pose.axis_rig[2]) > 0.8


@pytest.mark.parametrize("made", [tslot_plan, plate_plan])
def test_the_sheet_says_what_the_list_says(made: object) -> None:
    one = made()
    text = " ".join(line for page in read_sheet.pdf_lines(pdf_bytes(check_sheets(one), "x"))
                    for line in page)  # fmt: skip
    for row in rows(one).values():
        assert all(row[f] in text for f in (*PIXELS, *TAPES, *LEANS, "floor_mark", "second_mark"))
