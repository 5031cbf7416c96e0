"""A mount is drawn from the side from which it is set, and the sheet says which."""

from __future__ import annotations

import numpy as np
import pytest
from plans import plate_plan, tslot_plan

from rig.build.drawings import setting_sheets, view_sheets
from rig.build.drawings.items import CameraMark, Text
from rig.build.drawings.layout import views_of
from rig.build.mounts.plan import MountPlan

DEPTH_MM = 1.0


@pytest.mark.parametrize("made", [tslot_plan, plate_plan])
def test_views_are_a_third_angle_projection(made: object) -> None:
    front, top, side = views_of(made().structure)
    # The top view is the front folded back, the right side the front folded to the right.
    assert np.allclose(top.axes[0], front.axes[0]) and np.allclose(top.axes[2], front.axes[1])
    assert np.allclose(side.axes[1], front.axes[1]) and np.allclose(side.axes[2], front.axes[0])


def marks(plan: MountPlan) -> dict[str, float]:
    first = view_sheets(plan)[0]
    drawn = [i for i in first.items if isinstance(i, CameraMark)][: len(plan.mounts)]
    return {mark.name: mark.x_mm for mark in drawn}


@pytest.mark.parametrize(("made", "sign"), [(tslot_plan, 1.0), (plate_plan, -1.0)])
def test_left_on_the_front_view_is_left_for_whoever_sets_the_cameras(
    made: object, sign: float
) -> None:
    """From behind, a plate hides its cameras, and left and right are changed on it."""
    plan = made()
    places = {m.name: float(m.camera.pose.position_rig_mm[0]) for m in plan.mounts}
    drawn = marks(plan)
    for one in places:
        for other in places:
            if places[one] > places[other] + DEPTH_MM:
                assert sign * (drawn[one] - drawn[other]) > 0.0
    title = views_of(plan.structure)[0].title
    assert ("subject's side" in title) == (sign < 0.0)
    for sheet in (view_sheets(plan)[0], *setting_sheets(plan)):
        assert any(isinstance(i, Text) and i.words == title for i in sheet.items)
