"""Joints drawn apart: every kind once, numbered as the bill, inside its sheet."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from held_mounts import held
from plans import tslot_plan

from rig.build.drawings import dxf_bytes, exploded_sheets, pdf_bytes, svg_bytes
from rig.build.drawings.isometric import BALLOON_MM
from rig.build.drawings.items import Circle, Line, Text
from rig.build.mounts.plan import MountPlan
from rig.build.parts import bill_of_materials
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
MORE = re.compile(r"^(.+) on (.+?)(?:, and (\d+) more like it)?$")


def planned(kind: str) -> MountPlan:
    built = held(kind).with_stays().build()
    return replace(tslot_plan(2), structure=built.structure, mounts=built.mounts)


@pytest.mark.parametrize("kind", ["t-slot", "arc", "plate"])
def test_every_joint_is_of_one_kind_that_is_drawn(kind: str) -> None:
    plan = planned(kind)
    lines = bill_of_materials(plan, CATALOGUE).lines
    (sheet,) = exploded_sheets(plan, lines, CATALOGUE)
    bold = [i.words for i in sheet.items if isinstance(i, Text) and i.bold and i.height_mm < 2.5]
    told = [found for words in bold if (found := MORE.match(words))]
    assert sum(1 + int(found[3] or 0) for found in told) == len(plan.structure.joints)
    ends = {(joint.other, joint.on) for joint in plan.structure.joints}
    assert {(found[1], found[2]) for found in told} <= ends
    words = " ".join(i.words for i in sheet.items if isinstance(i, Text))
    assert re.search(r"4 × Hexagon socket head cap screw M5 × \d+ mm", words)
    assert "2 × Corner bracket for 2020" in words
    balloons = [i for i in sheet.items if isinstance(i, Circle) and i.radius_mm == BALLOON_MM]
    numbers = {i.words for i in sheet.items if isinstance(i, Text) and i.words.isdigit()}
    profile = next(str(k) for k, line in enumerate(lines, 1) if line.kind == "profile")
    assert profile in numbers and len(balloons) >= len(told)
    assert all(lines[int(n) - 1].length_mm or lines[int(n) - 1].quantity for n in numbers)


@pytest.mark.parametrize("kind", ["t-slot", "arc", "plate"])
def test_everything_lies_inside_the_frame_and_goes_on_along_a_line(kind: str) -> None:
    plan = planned(kind)
    (sheet,) = exploded_sheets(plan, bill_of_materials(plan, CATALOGUE).lines, CATALOGUE)
    runs = [i for i in sheet.items if isinstance(i, Line)]
    points = np.concatenate([run.points_mm for run in runs])
    assert points.min() >= 10.0 - 1e-9
    assert (points.max(axis=0) <= np.array([410.0, 287.0]) + 1e-9).all()
    ways = [run.points_mm for run in runs if run.style == "axis"]
    # Drawn apart by 63 mm or half of that, at 1 : 5 or larger; a way towards the viewer is short.
    lengths = [float(np.linalg.norm(np.diff(way, axis=0))) for way in ways]
    assert len(ways) >= 5 and np.median(lengths) > 0.5 * 63.0 * np.sqrt(1.0 / 3.0) / 5.0


def test_more_kinds_than_a_sheet_holds_go_on_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.build.drawings.exploded.GRIDS", ((2, 1),))
    plan = planned("arc")
    sheets = exploded_sheets(plan, bill_of_materials(plan, CATALOGUE).lines, CATALOGUE)
    # Five kinds, pivots on faces and on ends, levelling feet in a slot and in a bore.
    assert len(sheets) == 5
    for write in (lambda s: pdf_bytes(s, "a"), lambda s: svg_bytes(s, "a"), dxf_bytes):
        assert len(write(sheets)) > 1000


def test_a_plan_without_joints_has_no_such_sheet() -> None:
    bare = replace(tslot_plan(2).structure, joints=())
    assert exploded_sheets(replace(tslot_plan(2), structure=bare), (), CATALOGUE) == ()
