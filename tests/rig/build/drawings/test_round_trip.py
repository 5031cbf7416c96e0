"""From every drawing and list the poses are read back, and they are those of the plan."""

from __future__ import annotations

import csv
import io

import numpy as np
import plan_readers as read
import pytest
from plans import plate_plan, tslot_plan
from rigs import face, face_cameras, face_limits

from rig.build.drawings import (
    dxf_bytes,
    pdf_bytes,
    plate_sheets,
    poses_csv,
    setting_sheets,
    settings_csv,
    svg_bytes,
    tapes_csv,
    template_pages,
    template_sheet,
    view_sheets,
)
from rig.build.mounts.making import make_plan
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.systemfile import parse_system

POSITION_MM = 0.05 + 1e-9
"""Half of the 0.1 mm that lengths are stated to, along each axis."""

ROTATION_DEG = 3**0.5 * 0.005 + 1e-6
"""Three angles, each off by half of 0.01 degree at most."""

PLANS = {"t-slot": tslot_plan(5), "plate": plate_plan(), "many": tslot_plan(18)}


@pytest.fixture(params=PLANS)
def plan(request: pytest.FixtureRequest) -> MountPlan:
    return PLANS[request.param]


def check(plan: MountPlan, found: dict[str, read.ReadPose]) -> None:
    assert set(found) == {m.name for m in plan.mounts}
    for mount in plan.mounts:
        pose, got = mount.camera.pose, found[mount.name]
        off = got.from_datum_mm - (pose.position_rig_mm - plan.datum_rig_mm)
        assert np.abs(off).max() <= POSITION_MM
        rotation = read.rotation_rig_to_camera(got.pan_tilt_roll_deg)
        assert read.angle_between_deg(rotation, pose.rotation_rig_to_camera) <= ROTATION_DEG


def test_views_as_pdf_and_svg(plan: MountPlan) -> None:
    check_words_of_views(plan)


def check_words_of_views(plan: MountPlan) -> None:
    sheets = view_sheets(plan)
    for pages in (read.pdf_lines(pdf_bytes(sheets, "x")), read.svg_lines(svg_bytes(sheets, "x"))):
        assert len(pages) == len(sheets)
        check(plan, read.poses_in([line for page in pages for line in page]))


def test_views_as_dxf(plan: MountPlan) -> None:
    check_dxf_of_views(plan)


def check_dxf_of_views(plan: MountPlan) -> None:
    document = read.read_dxf(dxf_bytes(view_sheets(plan)))
    check(plan, read.poses_in(read.dxf_lines(document)))
    attributes = read.dxf_attributes(document)
    assert len(attributes) == 3 * len(plan.mounts)
    check(plan, read.poses_in(attributes))
    for name, (place, axis) in read.dxf_geometry(document).items():
        pose = next(m.camera.pose for m in plan.mounts if m.name == name)
        # DXF keeps 16 digits of coordinates up to some metres: 1e-9 mm.
        assert np.allclose(place, pose.position_rig_mm - plan.datum_rig_mm, atol=1e-6)
        assert np.allclose(axis, pose.axis_rig, atol=1e-8)


def settings_agree(plan: MountPlan, index: int, lines: list[str]) -> None:
    mount = plan.mounts[index]
    values = read.settings_in(lines)
    assert set(values) == {s.name for s in mount.settings}
    # Set is what the rig sinks by under its weight, too: without that weight it is not there.
    for give in (give for sag in plan.sags if sag.camera == mount.name for give in sag.gives):
        values[give.setting] -= give.set_more
    agree(mount, values)


def agree(mount: CameraMount, values: dict[str, float]) -> None:
    """Stated settings give the pose: exactly where they have a step, else as finely as stated.

    Lengths without a step are off by 0.05 mm at most, angles by 0.005 degree, which moves a
    camera on a lever of 300 mm by 0.026 mm; these add up at worst.
    """
    pose, wanted = mount.pose(values), mount.camera.pose
    made = [s.unit for s in mount.settings if s.step <= 0.0]
    angles_deg = 0.005 * made.count("deg")
    bound_mm = 0.05 * made.count("mm") + np.radians(angles_deg) * 300.0
    assert np.linalg.norm(pose.position_rig_mm - wanted.position_rig_mm) <= bound_mm + 1e-9
    off = read.angle_between_deg(pose.rotation_rig_to_camera, wanted.rotation_rig_to_camera)
    assert off <= angles_deg + 1e-6


@pytest.mark.parametrize("name", ["t-slot", "plate"])
def test_setting_sheets(name: str) -> None:
    check_setting_sheets(PLANS[name])


def check_setting_sheets(plan: MountPlan) -> None:
    sheets = setting_sheets(plan)
    pdf, svg = read.pdf_lines(pdf_bytes(sheets, "x")), read.svg_lines(svg_bytes(sheets, "x"))
    assert len(sheets) == len(pdf) == len(svg) == len(plan.mounts)
    found: list[dict[str, read.ReadPose]] = [{}, {}, {}]
    for index, sheet in enumerate(sheets):
        dxf = read.dxf_lines(read.read_dxf(dxf_bytes([sheet])))
        for lines, poses in zip((pdf[index], svg[index], dxf), found, strict=True):
            settings_agree(plan, index, lines)
            poses |= read.poses_in(lines)
            for tape in plan.mounts[index].tapes:
                assert any(
                    line == f"{tape.start} {tape.end} {tape.length_mm:.1f}" for line in lines
                )
    for poses in found:
        check(plan, poses)


def test_lists(plan: MountPlan) -> None:
    check_lists(plan)


def check_lists(plan: MountPlan) -> None:
    rows = csv.reader(io.StringIO(poses_csv(plan)))
    check(plan, read.poses_in([" ".join(row) for row in rows]))
    settings = list(csv.DictReader(io.StringIO(settings_csv(plan))))
    for mount in plan.mounts:
        values = {r["setting"]: float(r["value"]) for r in settings if r["camera"] == mount.name}
        agree(mount, values)
    tapes = list(csv.DictReader(io.StringIO(tapes_csv(plan))))
    lengths = [t.length_mm for m in plan.mounts for t in m.tapes]
    assert [float(t["length_mm"]) for t in tapes] == pytest.approx(lengths, abs=POSITION_MM)


def wanted_holes(plan: MountPlan) -> np.ndarray:
    plate = plan.structure.plates[0]
    corner = plate.outline_mm.min(axis=0)
    return np.array([[h.x_mm - corner[0], h.y_mm - corner[1], h.diameter_mm] for h in plate.holes])


def test_holes_of_a_plate_from_every_drawing_of_it() -> None:
    plan = PLANS["plate"]
    plate, wanted = plan.structure.plates[0], wanted_holes(plan)
    template = template_sheet(plate)
    assert np.allclose(read.dxf_holes(read.read_dxf(dxf_bytes([template]))), wanted, atol=1e-6)
    # SVG keeps thousandths of a millimetre.
    assert np.allclose(read.svg_holes(svg_bytes([template], "x")), wanted, atol=2e-3)
    drawing = read.read_dxf(dxf_bytes(plate_sheets(plan.name, plate)))
    assert np.allclose(read.dxf_holes(drawing), wanted, atol=1e-6), "a drawing at 1 : 2 too"
    rows = [
        line.split() for line in read.pdf_lines(pdf_bytes(plate_sheets(plan.name, plate), "x"))[0]
    ]
    stated = [[float(v) for v in row[2:5]] for row in rows if len(row) == 7 and row[5] == "through"]
    assert np.allclose(stated, wanted, atol=POSITION_MM)


@pytest.mark.parametrize("paper", ["A4", "A3"])
def test_holes_of_a_plate_from_its_tiled_template(paper: str) -> None:
    plan = PLANS["plate"]
    wanted = wanted_holes(plan)[:, :2]
    pages = read.pdf_holes(pdf_bytes(template_pages(plan.structure.plates[0], paper), "x"), 5.5)
    found = np.concatenate(pages)
    # The window's line is 0.13 mm wide and its place is stated to 0.1 mm.
    near = np.abs(found[:, None] - wanted[None]).max(axis=2) < 0.13 + 0.05
    assert near.any(axis=1).all() and near.any(axis=0).all()
    assert len(pages) == {"A4": 4, "A3": 2}[paper]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["t-slot", "plate", "arc"])
def test_a_plan_made_from_a_design(kind: str) -> None:
    subject, limits = face(), face_limits()
    cameras = face_cameras(subject, 4)
    plan = make_plan(cameras, subject, limits, parse_system(f'kind = "{kind}"'), trials=2)
    for read_back in (check_words_of_views, check_dxf_of_views, check_setting_sheets, check_lists):
        read_back(plan)
