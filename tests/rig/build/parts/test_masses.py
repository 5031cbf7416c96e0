"""What screws and nuts weigh, against a dealer's table and by their own solids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from held_mounts import held
from plans import tslot_plan
from scipy.spatial import ConvexHull

from rig.build.parts import bill_of_materials
from rig.build.parts.masses import small_part_g
from rig.build.statics.weights import Masses, weights
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
SOLD_G = {
    ("m3", 10.0): 0.9, ("m3", 20.0): 1.4, ("m4", 10.0): 1.8, ("m4", 20.0): 2.7, ("m5", 10.0): 2.7,
    ("m5", 20.0): 4.0, ("m6", 12.0): 5.1, ("m6", 20.0): 6.5, ("m8", 16.0): 12.1, ("m8", 20.0): 13.4,
}  # fmt: skip
"""DIN 912, Fuller's weight chart (fullerkr.com/collections/din-912-weight-chart)."""


@pytest.mark.parametrize(("size", "length_mm"), SOLD_G)
def test_screws_weigh_what_they_are_sold_with(size: str, length_mm: float) -> None:
    found = small_part_g(f"cap-screw-{size}", length_mm, CATALOGUE)
    # Real heads have chamfers and deeper sockets: a quarter of the head's metal at most, and the
    # table is rounded or cut to 0.1 g.
    head = small_part_g(f"cap-screw-{size}", 0.0, CATALOGUE)
    assert found is not None and head is not None
    sold = SOLD_G[size, length_mm]
    assert sold - 0.1 <= found <= sold + 0.1 + head / 4.0


@pytest.mark.parametrize("size", ["m3", "m5", "m8"])
def test_a_nut_is_its_hexagon_less_its_thread(size: str) -> None:
    nut = CATALOGUE.fasteners[f"hex-nut-{size}"]
    assert nut.across_flats_mm and nut.head_height_mm and nut.diameter_mm and nut.pitch_mm
    turn = np.radians(60.0 * np.arange(6))
    corners = nut.across_flats_mm / np.sqrt(3.0) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    bore = np.pi * (nut.diameter_mm / 2.0 - 0.6495 * nut.pitch_mm / 2.0) ** 2
    wanted = (float(ConvexHull(corners).volume) - bore) * nut.head_height_mm * 7.85e-3
    assert small_part_g(nut.id, None, CATALOGUE) == pytest.approx(wanted, rel=1e-9)


def test_t_nuts_are_taken_as_nuts_of_their_thread() -> None:
    for nut in (p for p in CATALOGUE.fasteners.values() if p.kind == "t-nut"):
        found = small_part_g(nut.id, None, CATALOGUE)
        assert found is not None
        size = nut.thread.lower()
        if f"hex-nut-{size}" in CATALOGUE.fasteners:
            # Height and width in diameters are those of the standard within a sixth.
            same = small_part_g(f"hex-nut-{size}", None, CATALOGUE)
            assert found == pytest.approx(same, rel=0.35)


def test_what_is_published_counts_before_what_is_computed() -> None:
    known = replace(CATALOGUE.fasteners["cap-screw-m5"], mass_g=9.0)
    catalogue = replace(CATALOGUE, fasteners={**CATALOGUE.fasteners, known.id: known})
    assert small_part_g("cap-screw-m5", 10.0, catalogue) == 9.0
    assert small_part_g("cap-screw-m5", None, CATALOGUE) is None
    assert small_part_g("end-cap-2020", None, CATALOGUE) is None


def test_bill_and_statics_weigh_the_same_screws() -> None:
    built = held("t-slot").build()
    plan = replace(tslot_plan(2), structure=built.structure, mounts=built.mounts)
    lines = [x for x in bill_of_materials(plan, CATALOGUE).lines if x.kind == "fastener"]
    assert {x.part for x in lines if x.mass_g} >= {"cap-screw-m5", "t-nut-2020"}
    hung = weights(plan.structure, plan.mounts, Masses(CATALOGUE))
    total = sum(weight.mass_kg for weight in hung if weight.joint)
    ids = {joint.id for joint in plan.structure.joints}
    placed = [part for part in plan.structure.parts if part.joint in ids and not part.camera]
    brackets = sum(small_part_g(part.part, None, CATALOGUE) or 0.0 for part in placed)
    assert 1e3 * total == pytest.approx(sum(x.mass_g or 0.0 for x in lines) + brackets)
