"""From a setting sheet alone, and nothing else, the pose of its camera: for every mount."""

from __future__ import annotations

import numpy as np
import plan_readers as read
import pytest
from sheet_plans import KINDS, plan

from rig.build.drawings import pdf_bytes, setting_sheets, svg_bytes
from rig.build.drawings.items import Text
from rig.build.drawings.layout import views_of


@pytest.mark.parametrize("kind", KINDS)
def test_the_pose_follows_from_the_sheet_alone(kind: str) -> None:
    sheets = setting_sheets(plan(kind))
    pdf, svg = read.pdf_lines(pdf_bytes(sheets, "x")), read.svg_lines(svg_bytes(sheets, "x"))
    for mount, *pages in zip(plan(kind).mounts, pdf, svg, strict=True):
        for lines in pages:
            values = read.settings_in(lines)
            assert set(values) == {s.name for s in mount.settings}
            centre, rotation = read.chain_pose(lines, values)
            # The sheet states settings to their step, made ones to 0.1 mm and 0.01 degree.
            stated = mount.pose(values)
            # Rows are stated to 0.01 mm and 0.001 degree, off by half of that at most: of eight
            # rows 0.04 mm and 0.004 degree if all fell one way, which they do not.
            off = centre - (stated.position_rig_mm - plan(kind).datum_rig_mm)
            assert np.abs(off).max() < 0.05
            turned = read.angle_between_deg(rotation, stated.rotation_rig_to_camera)
            assert turned < 0.005


def test_a_pivot_is_on_the_sheet() -> None:
    """The finding was a head on a pivot of 30 degrees of which its sheet said nothing."""
    pitched = [j for j in plan("t-slot").structure.joints if j.angle_deg]
    assert pitched, "the steep camera stands on a pivot: the test is about that"
    steep = next(m for m in plan("t-slot").mounts if pitched[0].id.startswith(m.name))
    index = plan("t-slot").mounts.index(steep)
    lines = read.pdf_lines(pdf_bytes(setting_sheets(plan("t-slot")), "x"))[index]
    stated = [abs(float(m[6])) for m in map(read.CHAIN_ROW.match, lines) if m]
    assert any(abs(angle - abs(pitched[0].angle_deg or 0.0)) < 1e-3 for angle in stated) or any(
        abs(angle - (90.0 - abs(pitched[0].angle_deg or 0.0))) < 1e-3 for angle in stated
    )


@pytest.mark.parametrize("kind", KINDS)
def test_the_tables_leave_the_pictures_alone(kind: str) -> None:
    shown = {view.title for view in views_of(plan(kind).structure)[:2]}
    for sheet in setting_sheets(plan(kind)):
        texts = [item for item in sheet.items if isinstance(item, Text)]
        rows = [text.y_mm for text in texts if text.words.startswith("#")]
        titles = [text.y_mm for text in texts if text.words in shown]
        assert len(titles) == 2 and min(rows) > max(titles) + 2.2, "the height of the title"
