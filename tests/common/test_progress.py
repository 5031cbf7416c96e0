"""Progress of a part as part of the whole."""

from __future__ import annotations

import pytest

from common.progress import Progress, Rising, within


def test_a_part_tells_its_share_of_the_whole() -> None:
    told: list[Progress] = []
    part = within(within(told.append, 0.2, 1.0), 0.0, 0.5)
    part(Progress("reading", 0.0, iteration=3))
    part(Progress("reading", 1.0))
    assert [p.fraction for p in told] == pytest.approx([0.2, 0.6])
    assert (told[0].stage, told[0].iteration) == ("reading", 3)


def test_what_is_done_stands_before_the_parts_own_stages() -> None:
    told: list[Progress] = []
    within(told.append, 0.5, 1.0, "matching")(Progress("cam01", 0.5))
    assert told == [Progress("matching, cam01", 0.75)]


def test_what_falls_in_a_part_does_not_fall_in_the_whole() -> None:
    told: list[Progress] = []
    report = Rising(told.append)
    for fraction in (0.18, 0.11, 0.22, 0.13):
        report(Progress("matching", fraction, iteration=len(told)))
    assert [p.fraction for p in told] == [0.18, 0.18, 0.22, 0.22]
    assert [p.iteration for p in told] == [0, 1, 2, 3]
