"""The isometric sheet: balloons that are the bill's numbers, each on its part."""

from __future__ import annotations

import numpy as np
import pytest
from plans import plate_plan, tslot_plan

from rig.build.drawings import isometric_sheets
from rig.build.drawings.isometric import BALLOON_MM, BEFORE, BEHIND
from rig.build.drawings.items import Circle, Line, Text
from rig.build.mounts.plan import MountPlan
from rig.build.page.planview import plan_figure
from rig.build.parts import bill_of_materials
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()


def drawn(plan: MountPlan) -> tuple[list[str], list[Circle], list[Line]]:
    """Numbers in balloons, the balloons, and their leaders."""
    lines = bill_of_materials(plan, CATALOGUE).lines
    items = isometric_sheets(plan, lines)[0].items
    balloons = [i for i in items if isinstance(i, Circle) and i.radius_mm == BALLOON_MM]
    numbers = [
        t.words for b in balloons for t in items
        if isinstance(t, Text) and t.anchor == "middle" and t.x_mm == b.x_mm
        and abs(t.y_mm - b.y_mm) < BALLOON_MM and t.words.isdigit()
    ]  # fmt: skip
    leaders = [
        i for i in items if isinstance(i, Line) and i.style == "thin" and len(i.points_mm) == 2
    ]
    return numbers, balloons, leaders


@pytest.mark.parametrize("plan", [tslot_plan(3), plate_plan()], ids=["t-slot", "plate"])
def test_every_part_with_a_place_has_the_number_of_its_line(plan: MountPlan) -> None:
    lines = bill_of_materials(plan, CATALOGUE).lines
    numbers, _, _ = drawn(plan)
    kinds = ("camera", "lens", "head", "profile", "plate", "wedge")
    wanted = {str(k) for k, line in enumerate(lines, 1) if line.kind in kinds}
    assert wanted <= set(numbers)
    assert len(numbers) == len(set(numbers))


def test_balloons_stand_apart_and_beside_the_rig() -> None:
    _, balloons, leaders = drawn(tslot_plan(3))
    centres = np.array([(b.x_mm, b.y_mm) for b in balloons])
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2) + 1e9 * np.eye(len(centres))
    assert gaps.min() > 2.0 * BALLOON_MM
    ends = np.array([leader.points_mm[0] for leader in leaders])
    for centre in centres:
        # A leader begins on the rim of its balloon.
        assert np.abs(np.linalg.norm(ends - centre, axis=1) - BALLOON_MM).min() < 1e-9


def test_all_three_axes_are_shortened_alike() -> None:
    for view in (BEHIND, BEFORE):
        short = np.linalg.norm(view.axes[:2], axis=0)
        assert np.allclose(short, np.sqrt(2.0 / 3.0))
        assert np.allclose(view.axes @ view.axes.T, np.eye(3))
    assert BEHIND.axes[2] @ np.array([0.0, 1.0, 0.0]) < 0.0 < BEFORE.axes[2] @ [0.0, 1.0, 0.0]


def test_a_plate_is_seen_from_the_side_of_its_cameras() -> None:
    """Its page used to show the back of the plate and hardly a camera."""
    for plan, behind in ((plate_plan(), False), (tslot_plan(2), True)):
        figure, _ = plan_figure(plan, plan.structure.solids)
        assert (figure.layout.scene.camera.eye.y < 0.0) == behind
