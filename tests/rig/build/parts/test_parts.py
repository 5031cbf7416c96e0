"""Bill of materials, cut list and joints: counts and sums worked out by hand."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from plan_readers import pdf_lines
from plans import plate_plan, tslot_plan

from common.errors import InputError, NotFoundError
from rig.build.drawings import pdf_bytes, view_sheets
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Member
from rig.build.parts import (
    Prices,
    bill_csv,
    bill_json,
    bill_of_materials,
    cut_list,
    cuts_csv,
    cuts_json,
    joints_csv,
    joints_json,
)
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()


@pytest.fixture(scope="module")
def tslot() -> MountPlan:
    return tslot_plan(2)


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_part_is_counted(tslot: MountPlan) -> None:
    bill = bill_of_materials(tslot, CATALOGUE)
    counts: Counter[str] = Counter()
    for line in bill.lines:
        counts[line.part] += line.quantity
    body, lens = CATALOGUE.parts_of(tslot.mounts[0].camera.camera.name) or (None, None)
    assert body is not None and lens is not None
    assert counts == {
        body.id: 2,
        lens.id: 2,
        "2020": 5,  # two uprights, two arms, one base
        "generic-ball-25": 2,
        "corner-2020": 2,
        "cap-screw-m5": 8,
        "t-nut-2020": 8,
        "stud-1-4-20": 2,
        "end-cap-2020": 6,  # both ends of the base, one of uprights that stand on it and of arms
    }


def test_masses_and_costs_add_up(tslot: MountPlan) -> None:
    prices = Prices("EUR", {"2020": 6.5, "corner-2020": 1.2})
    bill = bill_of_materials(tslot, CATALOGUE, prices)
    length = 2 * 1200.0 + 80.0 + 85.0 + 400.0
    by_part = {line.part: line for line in bill.lines}
    per_metre = CATALOGUE.profiles["2020"].mass_kg_per_m
    assert per_metre is not None
    assert by_part["2020"].length_mm == pytest.approx(length)
    assert by_part["2020"].mass_g == pytest.approx(per_metre * length)
    assert bill.cost == pytest.approx(6.5 * length / 1000.0 + 2 * 1.2)
    assert "cap-screw-m5" in bill.without_price
    assert bill.mass_g == pytest.approx(sum(x.mass_g or 0.0 for x in bill.lines))


def test_without_prices_there_is_no_cost(tslot: MountPlan) -> None:
    bill = bill_of_materials(tslot, CATALOGUE)
    assert bill.cost is None
    assert all(row["cost"] == row["price"] == "" for row in rows(bill_csv(bill)))
    assert json.loads(bill_json(bill))["total"]["cost"] is None


def test_plates_and_wedges_are_weighed() -> None:
    plan = plate_plan()
    volumes = {wedge.id: 40_000.0 for wedge in plan.structure.wedges}
    lines = {x.part: x for x in bill_of_materials(plan, CATALOGUE, None, volumes).lines}
    # 340 x 260 x 6 mm less a slot of 80 x 30 and six holes of 5.5 mm, aluminium 2.70 g/cm3.
    area = 340.0 * 260.0 - 80.0 * 30.0 - 6.0 * np.pi / 4.0 * 5.5**2
    assert lines["plate"].mass_g == pytest.approx(area * 6.0 * 2.70 / 1000.0)
    assert lines["wedge-left"].mass_g == pytest.approx(40.0 * 1.27)
    odd = replace(plan.structure.plates[0], material="unobtainium")
    strange = replace(plan, structure=replace(plan.structure, plates=(odd,)))
    assert "plate" in bill_of_materials(strange, CATALOGUE).without_mass


def test_fixed_cameras_are_not_bought(tslot: MountPlan) -> None:
    first = tslot.mounts[0]
    there = replace(first, camera=replace(first.camera, fixed=True))
    bill = bill_of_materials(replace(tslot, mounts=(there, *tslot.mounts[1:])), CATALOGUE)
    assert {x.quantity for x in bill.lines if x.kind in ("camera", "lens")} == {1}


def test_a_camera_that_is_in_no_catalogue_is_listed_by_its_name(tslot: MountPlan) -> None:
    first = tslot.mounts[0]
    own = replace(
        first, camera=replace(first.camera, camera=replace(first.camera.camera, name="own"))
    )
    bill = bill_of_materials(replace(tslot, mounts=(own,)), CATALOGUE)
    assert bill.lines[0].name == "own" and bill.lines[0].mass_g is None


def test_unknown_parts_and_prices_are_refused(tslot: MountPlan) -> None:
    odd = replace(tslot.structure.parts[0], part="generic-ball-26")
    plan = replace(tslot, structure=replace(tslot.structure, parts=(odd,)))
    with pytest.raises(NotFoundError, match="generic-ball-25"):
        bill_of_materials(plan, CATALOGUE)
    with pytest.raises(NotFoundError, match="corner-2020"):
        bill_of_materials(tslot, CATALOGUE, Prices("EUR", {"corner-202": 1.0}))
    with pytest.raises(InputError, match="zero or more"):
        Prices("EUR", {"2020": float("nan")})


def test_the_cut_list_groups_equal_lengths(tslot: MountPlan) -> None:
    cuts = cut_list(tslot, CATALOGUE)
    assert [(c.role, round(c.length_mm, 1), c.quantity) for c in cuts] == [
        ("upright", 1200.0, 2),
        ("base", 400.0, 1),
        ("arm", 85.0, 1),
        ("arm", 80.0, 1),
    ]
    table = rows(cuts_csv(cuts))
    assert table[0]["members"] == "upright-c1; upright-c2" and table[0]["length_mm"] == "1200.0"
    assert json.loads(cuts_json(cuts))["cuts"][0]["members"] == ["upright-c1", "upright-c2"]
    assert sum(int(r["quantity"]) for r in table) == len(tslot.structure.members)


def test_a_mitred_piece_is_listed_with_its_angles_and_its_longer_side(tslot: MountPlan) -> None:
    axis = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 400.0]])
    square = Member("a", "2020", "facet", axis, np.eye(3)[0], (20.0, 20.0))
    mitred = replace(square, id="b", mitres_deg=(0.0, 10.0))
    plan = replace(tslot, structure=replace(tslot.structure, members=(square, mitred)))
    first, second = rows(cuts_csv(cut_list(plan, CATALOGUE)))
    assert (first["mitre_end_deg"], first["long_side_mm"]) == ("0.00", "400.0")
    # Half the depth, 10 mm, times the tangent of 10 degrees: 1.76 mm.
    assert (second["mitre_end_deg"], second["long_side_mm"]) == ("10.00", "401.8")
    assert json.loads(cuts_json(cut_list(plan, CATALOGUE)))["cuts"][1]["mitres_deg"] == [0.0, 10.0]


def test_a_bent_member_is_cut_to_its_arc(tslot: MountPlan) -> None:
    angles = np.radians(np.linspace(0.0, 90.0, 10))
    axis = 500.0 * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    bent = Member("arc", "2020", "arc", axis, np.array([0.0, 0.0, 1.0]), (20.0, 20.0), 500.0)
    plan = replace(tslot, structure=replace(tslot.structure, members=(bent,)))
    (cut,) = cut_list(plan, CATALOGUE)
    assert cut.length_mm == pytest.approx(500.0 * np.pi / 2.0)
    assert rows(cuts_csv((cut,)))[0]["radius_mm"] == "500.0"


def test_joints_say_where_to_mark_the_member(tslot: MountPlan) -> None:
    table = {row["joint"]: row for row in rows(joints_csv(tslot))}
    assert table["joint-c1"]["along_mm"] == "560.0" and table["joint-c1"]["angle_deg"] == ""
    on = {member.id: member.start for member in tslot.structure.members}
    assert table["joint-c1"]["along_from"] == on[table["joint-c1"]["on"]] == "lower end"
    assert table["joint-c1"]["fasteners"] == "2xcap-screw-m5; 2xt-nut-2020"
    document = json.loads(joints_json(tslot))["joints"]
    assert [j["joint"] for j in document] == list(table)
    assert [j["side"] for j in document] == [row["side"] for row in table.values()]


def test_joints_stand_in_the_list_where_the_drawing_has_them(tslot: MountPlan) -> None:
    """The finding was one joint at two places: in the frame of the scan, and from the datum."""
    assert np.abs(tslot.datum_rig_mm).max() > 1.0, "else the frames are the same"
    lines = [line for page in pdf_lines(pdf_bytes(view_sheets(tslot), "x")) for line in page]
    assert any("Joints, from the datum" in line for line in lines)
    for row in rows(joints_csv(tslot)):
        places = " ".join(row[f"{axis}_from_datum_mm"] for axis in "xyz")
        assert any(line.startswith(row["joint"]) and places in line for line in lines), row


def test_a_name_like_a_formula_stays_text(tslot: MountPlan) -> None:
    first = tslot.mounts[0]
    kind = replace(first.camera.camera, name='=HYPERLINK("x")')
    evil = replace(first, camera=replace(first.camera, camera=kind))
    text = bill_csv(bill_of_materials(replace(tslot, mounts=(evil,)), CATALOGUE))
    assert rows(text)[0]["name"].startswith(" =")
