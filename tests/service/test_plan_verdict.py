"""What ``rigwright plan`` says of a rig that should not be built."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plans import tslot_plan

from rig.build.mounts.plan import Clash, Give, Sag, Stance
from service.cli.commands.plan import caution, why_not
from service.cli.tables.plan_tables import print_plan
from service.kinds.plan import PlanClash, PlanNetwork, PlanPrice, PlanResult
from service.tasks.planning import in_short

ROWS = ["coverage/2", "clearance/cam01/cam02", "focus/cam03", "frame/cam04"]


def network(*broken: str) -> PlanNetwork:
    return PlanNetwork(
        sigma_median_mm=0.03,
        sigma_p95_mm=0.05,
        coverage_2_views=1.0,
        coverage_3_views=0.98,
        feasible=not broken,
        broken=list(broken),
    )


def result(
    *, designed: PlanNetwork, built: PlanNetwork, clashes: tuple[PlanClash, ...] = ()
) -> PlanResult:
    price = PlanPrice(
        designed=designed, rounded=built, built=built, sigma_loss=0.01, coverage_loss=0.0
    )
    return PlanResult(
        name="",
        system="t-slot",
        buildable=not clashes,
        clashes=list(clashes),
        price=price,
        yield_share=1.0,
        yield_trials=100,
        tightest=[],
        members=0,
        member_length_mm=0.0,
        plates=0,
        wedges=0,
        parts=0,
        cameras=[],
        steps=[],
        notes=[],
    )


POST = PlanClash(kind="view", one="cam01", other="U2", clearance_mm=-3.0, required_mm=5.0)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (result(designed=network(*ROWS), built=network(*ROWS), clashes=(POST,)), "design itself"),
        (result(designed=network(), built=network(), clashes=(POST,)), "U2 stands in the view"),
        (result(designed=network(*ROWS), built=network()), "and 1 more"),
    ],
)
def test_the_first_cause_is_told(made: PlanResult, words: str) -> None:
    assert words in why_not(made)


def test_a_sound_rig_gets_no_word() -> None:
    made = result(designed=network(), built=network())
    assert not why_not(made)
    assert not caution(made)


def test_limits_lost_by_rounding_are_a_caution() -> None:
    made = result(designed=network(), built=network(ROWS[0]))
    assert not why_not(made)
    assert "(coverage/2)" in caution(made)


@pytest.mark.parametrize(("off_deg", "sound"), [(0.4, True), (0.6, False)])
def test_a_rig_that_leans_too_far_is_not_buildable(off_deg: float, sound: bool) -> None:
    """It was called buildable as long as nothing clashed."""
    give = Give("tilt", "deg", off_deg, 0.5, 1.0)
    sag = Sag("c1", np.zeros(3), off_deg, 0.1, 0.1, (give,))
    made = replace(tslot_plan(2), clashes=(), sags=(sag,))
    short = in_short(made)
    assert short.buildable == sound and bool(short.sags[0].too_far) != sound
    hit = Clash("solid", "a", "b", -1.0, 2.0)
    assert not in_short(replace(made, clashes=(hit,))).buildable


@pytest.mark.parametrize(("tips_n", "sound"), [(26.0, True), (11.0, False), (-3.0, False)])
def test_of_a_rig_that_tips_over_it_is_told(tips_n: float, sound: bool) -> None:
    way = np.array([0.0, 1.0])
    stance = Stance(("left foot",), 10.0, np.zeros(3), 1200.0, 20.0, tips_n, "away", way)
    short = in_short(replace(tslot_plan(2), clashes=(), stances=(stance,)))
    assert bool(short.stances[0].too_little) != sound
    assert ("left foot is tipped away" in caution(short)) != sound


def test_the_table_says_how_many_limits_rounding_breaks_and_which(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In a cell they were cut to three equal words that did not say they were broken."""
    names = [f"depth_of_field/cam0{k}" for k in range(1, 6)]
    print_plan(result(designed=network(), built=network(*names, "base_height_neighbour/a-b")))
    told = " ".join(capsys.readouterr().out.split())
    assert "6 broken" in told and "kept" in told and "…" not in told
    assert (
        "broken each setting rounded: depth_of_field (cam01, cam02, cam03, cam04, cam05); "
        "base_height_neighbour (a-b)"
    ) in told
