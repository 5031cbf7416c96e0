"""Frames that lean under their cameras: found, mended, and told to who builds them."""

from __future__ import annotations

import csv
import html
import io
import re
from dataclasses import replace

import numpy as np
import plan_readers as read
import pytest
from held_mounts import AROUND, four_cameras, held
from plans import tslot_plan

from common.errors import InputError
from rig.build.drawings import pdf_bytes, setting_sheets, settings_csv
from rig.build.mounts.clashes import find_clashes
from rig.build.mounts.making import SystemSpec
from rig.build.mounts.plan import Give, MountPlan, Sag
from rig.build.mounts.planfile import plan_document, plan_from_mapping
from rig.build.mounts.steps import assembly_steps
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.page.planpage import render_plan_page
from rig.build.page.stiffness import stiffness
from rig.build.parts import bill_of_materials
from rig.build.statics.sag import sags
from rig.build.statics.stiffening import advice, settled_sags, stiffened
from rig.build.statics.weights import Masses
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()


def spec(kind: str, **keys: object) -> SystemSpec:
    return system_from_mapping({"kind": kind, **keys})


def leans(kind: str, **keys: object) -> tuple[float, float, tuple[str, ...]]:
    """The worst lean as first arranged and as stiffened, and what is told."""
    asked, plain = spec(kind, **keys), held(kind).build()
    mended = stiffened(asked.system, asked.larger, four_cameras(), AROUND, asked.masses)
    built = mended.first.build()
    found = [sags(b.structure, b.mounts, (), asked.masses) for b in (plain, built)]
    before, after = (max(sag.lean_deg for sag in each) for each in found)
    return before, after, mended.notes


@pytest.mark.parametrize(("kind", "camera_kg"), [("t-slot", 1.0), ("arc", 0.25)])
def test_cameras_lean_less_than_half_a_step_of_their_heads(kind: str, camera_kg: float) -> None:
    before, after, notes = leans(kind, camera_kg=camera_kg)
    assert after < 0.5
    assert after <= before
    assert (before > 0.35) == bool(notes), "what is built in is told, and nothing is without need"


def test_a_profile_that_was_asked_for_stays_and_one_is_named_that_would_do() -> None:
    before, after, notes = leans("t-slot", camera_kg=3.0, profile="2020")
    assert 0.5 < after < before
    assert len(notes) == 1 and "Back-stays" in notes[0]
    asked = spec("t-slot", camera_kg=3.0, profile="2020")
    built = held("t-slot").with_stays().build()
    words = advice(built.structure, built.mounts, (), asked.masses)
    assert words.startswith("profile ") or "lighter" in words


def test_stays_touch_nothing_and_stand_on_their_sill() -> None:
    for kind in ("t-slot", "arc"):
        built = held(kind).with_stays().build()
        stays = {m.id for m in built.structure.members if m.role in ("stay", "sill")}
        assert len(stays) > 1
        found = find_clashes(
            built.structure.solids, built.joined, tuple(m.camera for m in built.mounts), AROUND
        )
        assert not [clash for clash in found if {clash.one, clash.other} & stays], kind


def test_what_hangs_on_a_frame_is_weighed() -> None:
    """Twice the cameras' mass adds as much sag again: the frame is linear."""
    built = held("t-slot").build()
    one, two, three = (
        sags(built.structure, built.mounts, (), Masses(CATALOGUE, kg))[0].shift_mm
        for kg in (0.5, 1.0, 1.5)
    )
    # 1e-9: the solver's rounding, of millimetres.
    assert np.allclose(three - two, two - one, rtol=0.0, atol=1e-9)
    assert float((two - one)[2]) < 0.0


def test_a_plan_of_which_too_little_is_known_says_so() -> None:
    built = held("plate").build()
    plates = tuple(replace(p, material="unobtainium") for p in built.structure.plates)
    structure = replace(built.structure, plates=plates)
    found, notes = settled_sags(structure, built.mounts, (), Masses(CATALOGUE))
    assert found == () and "unobtainium" in notes[0]
    with pytest.raises(InputError, match="unobtainium"):
        sags(structure, built.mounts, (), Masses(CATALOGUE))


def sagging(off_deg: float) -> MountPlan:
    plan = tslot_plan(2)
    gives = tuple(
        Give(s.name, s.unit, -2.6 if s.unit == "mm" else off_deg, 0.8, s.step)
        for s in plan.mounts[0].settings
    )
    sag = Sag(plan.mounts[0].name, np.array([0.1, 2.0, -2.6]), abs(off_deg), 3.0, 0.4, gives)
    return replace(plan, sags=(sag,))


def test_millimetres_are_aimed_out_and_degrees_are_not() -> None:
    plan = sagging(0.3)
    assert not plan.leaning
    give = plan.sags[0].gives[0]
    assert give.aim_out == 3.0 and give.left == pytest.approx(0.4)
    leaning = sagging(-0.9).leaning
    assert len(leaning) == 1
    assert "leans by 0.90 degrees" in leaning[0].words and "the limit is 0.80" in leaning[0].words


def test_the_sheet_says_what_to_set_more() -> None:
    lines = "\n".join(read.pdf_lines(pdf_bytes(setting_sheets(sagging(0.3)), "x"))[0])
    assert "For its weight" in lines and "+3" in lines and "(0.30)" in lines
    assert "do not set it" in lines
    assert "-2.600,3,563" in settings_csv(sagging(0.3))


def test_sheet_steps_list_and_page_say_to_set_the_same() -> None:
    """The finding was a builder who followed the steps and set a millimetre too much."""
    plan = sagging(0.3)
    mount = plan.mounts[0]
    lines = read.pdf_lines(pdf_bytes(setting_sheets(plan), "x"))[0]
    sheet = read.settings_in(lines)
    listed = [row for row in csv.DictReader(io.StringIO(settings_csv(plan)))
              if row["camera"] == mount.name]  # fmt: skip
    steps = " ".join(assembly_steps(plan.structure, plan.mounts, CATALOGUE, plan.sags))
    page = html_words(render_plan_page(plan, bill_of_materials(plan, CATALOGUE), ()))
    assert {row["setting"]: float(row["set_to"]) for row in listed} == sheet
    for setting in mount.settings:
        more = 3.0 if setting.unit == "mm" else 0.0
        assert sheet[setting.name] == setting.value + more
        told = f"{setting.name} {sheet[setting.name]:.0f} "
        assert f"{told}{'mm' if more else 'degrees'}" in steps
        beside = r"mm (\([\d.]+\) )?3 more for its weight" if more else "°"
        assert re.search(f"{re.escape(told)}{beside}", page), told
    assert "which is 560 and 3 more for its weight" in steps
    # The way to the camera counts without it: so the sheet still gives the camera's pose.
    centre, _ = read.chain_pose(lines, mount.values())
    off = centre - (mount.camera.pose.position_rig_mm - plan.datum_rig_mm)
    # Rows to 0.01 mm and 0.001 degree, as where sheets without a weight are read.
    assert np.abs(off).max() < 0.05
    assert any("leave out here what is for its weight" in line for line in lines)


def html_words(page: str) -> str:
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())


def test_the_page_shows_it_and_the_file_keeps_it() -> None:
    plan = sagging(-0.9)
    assert "<b>" in stiffness(plan) and plan.sags[0].camera in stiffness(plan)
    assert stiffness(replace(plan, sags=())) == ""
    document = plan_document(plan)
    assert plan_document(plan_from_mapping(document)) == document
    older = {key: value for key, value in document.items() if key != "sags"}
    assert plan_from_mapping(older).sags == ()
