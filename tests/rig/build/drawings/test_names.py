"""Names on drawings stand clear of bars, of each other and of figures."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.arrays import Floats
from rig.build.drawings.annotate import Labels, text_box
from rig.build.drawings.items import Line, Text
from rig.build.drawings.pdf import text_width_mm

RNG = np.random.default_rng(5)


def passes(line: Floats, low: Floats, high: Floats) -> bool:
    """By walking along it in steps of a hundredth of a millimetre or less."""
    count = int(np.ceil(np.linalg.norm(line[1] - line[0]) / 0.01)) + 1
    points = line[0] + np.linspace(0.0, 1.0, count)[:, None] * (line[1] - line[0])
    return bool(((points > low) & (points < high)).all(axis=1).any())


def named(labels: Labels, at: Floats) -> Text:
    return next(i for i in labels.place("cam05", *at, 2.0, "camera") if isinstance(i, Text))


@pytest.mark.parametrize("trial", range(20))
def test_a_name_is_not_written_over_a_bar(trial: int) -> None:
    """The finding was a name that could not be read, with the bars of a stub through it."""
    rng = np.random.default_rng(trial)
    at = np.array([100.0, 100.0])
    ends = at + rng.uniform(-12.0, 12.0, size=(4, 2, 2))
    labels = Labels()
    labels.keep_off_items([Line(line, "visible") for line in ends])
    low, high = text_box(named(labels, at))
    assert not any(passes(line, low, high) for line in ends)


def test_where_lines_are_everywhere_a_name_still_keeps_off_figures() -> None:
    rows = np.arange(50.0, 150.0, 0.8)
    grid = [Line(np.array([[50.0, y], [150.0, y]]), "visible") for y in rows]
    figure = Text("-799.0", 103.0, 101.0, 2.0)
    labels = Labels()
    labels.keep_off_items([*grid, figure])
    low, high = text_box(named(labels, np.array([100.0, 100.0])))
    taken_low, taken_high = text_box(figure)
    assert (np.minimum(high, taken_high) - np.maximum(low, taken_low)).min() < 0.0


@pytest.mark.parametrize(("anchor", "share"), [("start", 0.0), ("middle", 0.5), ("end", 1.0)])
def test_the_box_of_a_text_is_where_it_is_written(anchor: str, share: float) -> None:
    wide = text_width_mm("cam05", 2.0)
    lying, upright = (
        text_box(Text("cam05", 10.0, 20.0, 2.0, anchor, angle_deg=angle)) for angle in (0.0, 90.0)
    )
    assert np.allclose(lying, [[10.0 - share * wide, 20.0], [10.0 + (1.0 - share) * wide, 22.0]])
    assert np.allclose(upright, [[8.0, 20.0 - share * wide], [10.0, 20.0 + (1.0 - share) * wide]])
