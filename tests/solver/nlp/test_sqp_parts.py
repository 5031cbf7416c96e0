"""The SQP method's parts on programs small enough to solve by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from geometry.arrays import Floats
from solver.constraints.base import bound
from solver.constraints.candidates import CandidateConstraints
from solver.constraints.positions import PositionCoordinate, PositionDistance
from solver.nlp.iterate import Iterate, Point
from solver.nlp.penalty import LARGEST_PENALTY, LEAST_PENALTY, Penalty
from solver.nlp.program import NonlinearProgram
from solver.nlp.quadratic import Linearised, convex, quadratic_step, stationarity
from solver.nlp.sqp import minimise
from solver.nlp.working_program import WorkingProgram
from solver.variables import NetworkState, Unknowns

X, Y, Z = 3, 4, 5


@dataclass(frozen=True)
class Bowl:
    """Half the squared distance of the first camera from ``bottom`` (3,), ``flat`` along it."""

    bottom: tuple[float, float, float]

    def value(self, state: NetworkState) -> float:
        return float(0.5 * ((state.centre[0] - self.bottom) ** 2).sum())

    def gradient(self, state: NetworkState) -> Floats:
        out = np.zeros(7 * len(state.centre))
        out[3:6] = state.centre[0] - self.bottom
        return out

    def hessian(self, state: NetworkState) -> Floats:
        out = np.zeros((7 * len(state.centre),) * 2)
        out[3:6, 3:6] = np.eye(3)
        return out


def unknowns(free: tuple[int, ...] = (X, Y, Z)) -> Unknowns:
    return Unknowns(np.eye(3)[None], np.zeros(3), 1.0, np.array(free))


def coordinates(family: str, axes: list[int], low: list[float], high: list[float]):  # noqa: ANN201
    """Rows ``low <= C[axis] <= high`` of one camera."""
    m = len(axes)
    block = PositionCoordinate(
        family,
        "mm",
        1.0,
        np.array(low),
        np.array(high),
        np.zeros(m, np.int64),
        np.array(axes),
        np.zeros(m),
    )
    return CandidateConstraints.all_of(block)


def at_least(family: str, axis: int, value: float):  # noqa: ANN201
    return coordinates(family, [axis], [value], [np.inf])


def at_most(family: str, axis: int, value: float):  # noqa: ANN201
    return coordinates(family, [axis], [-np.inf], [value])


def program(*rows: CandidateConstraints, bottom=(0.0, 0.0, 0.0), **changes):  # noqa: ANN001, ANN003, ANN201
    bounds = np.full(7, -np.inf), np.full(7, np.inf)
    return NonlinearProgram(unknowns(), Bowl(bottom), list(rows), bounds, **changes)


def start(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Floats:
    return np.array([0.0, 0.0, 0.0, x, y, z, 1.0])


def solve(nlp: NonlinearProgram, at: Floats | None = None, **how):  # noqa: ANN003, ANN201
    return minimise(nlp, start(2.0, 1.0, -1.0) if at is None else at, lambda *_: True, **how)


# --- the program ------------------------------------------------------------------------------


def test_families_that_are_penalised_one_by_one_are_told_apart() -> None:
    nlp = program(at_least("a", 0, 1.0), at_least("b", 1, 1.0), at_most("a", 2, 5.0), each=("b",))
    assert nlp.families == ("a",)


def test_violations_are_the_worst_row_or_the_sum() -> None:
    rows = (
        coordinates("a", [0, 1], [1.0, 5.0], [np.inf, np.inf]),
        at_most("a", 2, -3.0),
        coordinates("b", [0, 1, 2], [1.0, 5.0, -9.0], [np.inf] * 3),
    )
    found = program(*rows, each=("b",)).violations(start())
    assert found == {"a": 5.0, "b": 6.0}
    assert program(*rows, each=("b",)).worst(found) == 5.0
    assert program(each=("b",)).worst({"b": 3.0}) == 0.0


# --- penalties --------------------------------------------------------------------------------


def test_a_charge_weighs_each_family_by_its_own() -> None:
    nlp = program(
        at_least("a", 0, 1.0),
        at_least("b", 1, 1.0),
        at_least("c", 2, 1.0),
        each=("b",),
        each_penalty=7.0,
        weights={"c": 3.0},
    )
    penalty = Penalty(10.0)
    assert penalty.of_family(nlp, "a") == 10.0
    assert penalty.of_family(nlp, "b") == 7.0
    assert penalty.of_family(nlp, "c") == 30.0
    assert penalty.charge(nlp, {"a": 1.0, "b": 2.0, "c": 0.5}) == 10.0 + 14.0 + 15.0


def test_a_penalty_rises_tenfold_up_to_its_largest() -> None:
    assert Penalty(10.0, 2).raised() == Penalty(100.0, 2)
    assert Penalty(0.5 * LARGEST_PENALTY).raised().weight == LARGEST_PENALTY


def after(penalty: Penalty, multiplier: float, before: float, left: float, worst: float):  # noqa: ANN201
    nlp = program(at_least("a", 0, 1.0))
    return penalty.after_step(nlp, (np.array([-multiplier]),), before, left, worst)


def test_a_penalty_that_leaves_violations_standing_three_times_rises() -> None:
    penalty = Penalty(10.0)
    for refused in (1, 2):
        penalty = after(penalty, 1.0, before=0.1, left=0.06, worst=0.1)
        assert penalty == Penalty(10.0, refused)
    assert after(penalty, 1.0, before=0.1, left=0.06, worst=0.1) == Penalty(50.0, 0)
    assert after(penalty, 1.0, before=0.1, left=0.04, worst=0.1) == Penalty(10.0, 0)
    assert after(penalty, 9.0, before=1e-7, left=1e-7, worst=1e-7) == Penalty(10.0, 0)


def test_a_penalty_far_above_the_multipliers_falls_to_twice_their_sum() -> None:
    assert after(Penalty(100.0), 3.0, before=0.0, left=0.0, worst=0.0) == Penalty(6.0)
    assert after(Penalty(11.9), 3.0, before=0.0, left=0.0, worst=0.0) == Penalty(11.9)
    assert after(Penalty(100.0), 0.0, 0.0, 0.0, 0.0).weight == LEAST_PENALTY
    # While something is still violated and left so, the penalty stays.
    assert after(Penalty(100.0), 3.0, before=1e-3, left=1e-4, worst=1e-3) == Penalty(100.0)


def test_a_dearer_family_needs_less_of_the_common_weight() -> None:
    nlp = program(at_least("a", 0, 1.0), weights={"a": 10.0})
    found = Penalty(100.0).after_step(nlp, (np.array([30.0]),), 0.0, 0.0, 0.0)
    assert found == Penalty(6.0)


# --- iterates and working sets ----------------------------------------------------------------


def first(nlp: NonlinearProgram, at: Floats, radius: float = 0.2) -> Iterate:
    return Iterate.first(nlp, at, None, 50.0, radius)


def test_the_first_iterate_is_inside_its_bounds_with_the_multipliers_known() -> None:
    nlp = program(at_least("a", 0, 1.0), at_least("b", 1, 1.0))
    nlp = replace(nlp, bounds=(np.full(7, -0.5), np.full(7, 0.5)))
    iterate = Iterate.first(nlp, start(9.0, -9.0, 0.1), [np.array([3.0])], 50.0, 0.2)
    np.testing.assert_array_equal(iterate.point.values, [0, 0, 0, 0.5, -0.5, 0.1, 0.5])
    assert [m.tolist() for m in iterate.multipliers] == [[3.0], [0.0]]
    assert iterate.worst == 1.5


def test_the_merit_adds_the_charge_to_the_cost() -> None:
    nlp = program(at_least("a", 0, 1.0))
    point = Point.at(nlp, start(0.5))
    assert point.merit(nlp, Penalty(10.0)) == pytest.approx(0.125 + 5.0)


def many_rows(slacks: list[float], keep: int = 2) -> CandidateConstraints:
    """Rows C[0] >= -slack of one group, of which the tightest ``keep`` are worked on."""
    m = len(slacks)
    block = coordinates("a", [0] * m, [-s for s in slacks], [np.inf] * m).block
    return CandidateConstraints(block, np.zeros(m, np.int64), keep)


def test_the_working_set_has_the_tightest_rows_within_reach_and_what_has_multipliers() -> None:
    nlp = program(many_rows([0.5, 0.01, 0.02, 0.03, 9.0]))
    iterate = first(nlp, start())
    assert [c.tolist() for c in iterate.working_set().chosen] == [[1, 2]]
    held = replace(iterate, multipliers=(np.array([0.0, 0.0, 0.0, 0.0, -1.0]),))
    assert [c.tolist() for c in held.working_set().chosen] == [[1, 2, 4]]
    # 1.5 of the radius is the reach: 0.015 holds one row only.
    near = replace(iterate, radius=0.01)
    assert [c.tolist() for c in near.working_set().chosen] == [[1]]


def test_what_a_trial_violates_is_worked_on_from_then_on() -> None:
    nlp = program(many_rows([0.5, 0.01, 0.02, 0.03, 9.0]))
    iterate = first(nlp, start())
    tried = iterate.holding_violated(start(-0.6))
    assert set(tried.held[0].tolist()) >= {0, 1, 2, 3}
    assert 0 in tried.working_set().chosen[0]
    assert 4 not in tried.working_set().chosen[0]


def test_multipliers_of_working_rows_go_back_to_their_candidates() -> None:
    nlp = program(many_rows([0.5, 0.01, 0.02, 0.03, 9.0]))
    iterate = first(nlp, start())
    spread = iterate.working_set().multipliers(np.array([-2.0, 1e-12]), iterate.multipliers)
    assert [m.tolist() for m in spread] == [[0.0, -2.0, 0.0, 0.0, 0.0]]


def test_a_violated_row_of_its_own_penalty_is_unpaid_until_its_multiplier_says_so() -> None:
    nlp = program(at_least("a", 0, 1.0), each=("a",), each_penalty=10.0)
    iterate = first(nlp, start())
    assert iterate.unpaid
    assert not replace(iterate, multipliers=(np.array([-10.0]),)).unpaid
    assert replace(iterate, multipliers=(np.array([-4.9]),)).unpaid
    assert not first(nlp, start(1.0)).unpaid
    assert not first(program(at_least("a", 0, 1.0)), start()).unpaid


# --- the working program ----------------------------------------------------------------------


def working(*rows: CandidateConstraints, **changes: object) -> WorkingProgram:
    nlp = program(*rows, **changes)
    return first(nlp, start(0.3, -0.2, 0.1)).working_set().program


def test_each_family_has_one_slack_and_each_single_row_its_own() -> None:
    both = coordinates("a", [0, 1], [1.0, 1.0], [2.0, np.inf])
    single = coordinates("b", [0, 2], [5.0, 5.0], [np.inf, np.inf])
    nlp = working(both, single, each=("b",), each_penalty=7.0)
    assert nlp.slack_count == 3
    np.testing.assert_array_equal(nlp.penalties, [50.0, 7.0, 7.0])
    assert nlp.size == 6
    # Two lower sides and one upper one of "a", two lower ones of "b".
    assert nlp.rows == 5
    low, high = nlp.row_bounds
    np.testing.assert_array_equal(low, [1.0, 1.0, -np.inf, 5.0, 5.0])
    np.testing.assert_array_equal(high, [np.inf, np.inf, 2.0, np.inf, np.inf])


def test_slack_enters_rows_on_the_side_that_helps() -> None:
    nlp = working(coordinates("a", [0, 1], [1.0, 1.0], [2.0, 2.0]))
    x = nlp.pack(start(0.3, -0.2, 0.1))
    x[-1] = 0.25
    np.testing.assert_allclose(nlp.values(x), [0.55, 0.05, 0.05, -0.45], atol=1e-15)
    assert nlp.objective(x) == pytest.approx(0.5 * 0.14 + 50.0 * 0.25)


def test_derivatives_of_the_working_program_match_central_differences() -> None:
    distance = PositionDistance(
        "c", "mm", 1.0, bound(0.5, [0.0]), bound(2.0, [0.0]), np.array([0]), np.ones((1, 3))
    )
    nlp = working(
        coordinates("a", [0, 1], [1.0, 1.0], [2.0, 2.0]),
        CandidateConstraints.all_of(distance),
        each=("c",),
    )
    x = nlp.pack(start(0.3, -0.2, 0.1)) + 0.1
    step = 1e-6

    def numeric(function):  # noqa: ANN001, ANN202
        moves = step * np.eye(len(x))
        return np.stack([(function(x + e) - function(x - e)) / (2 * step) for e in moves], axis=-1)

    dense = np.zeros((nlp.rows, nlp.size))
    dense[nlp.jacobian_pattern] = nlp.jacobian(x)
    # Rounding over the step, 1e-16 / 1e-6, and a curvature of order one times the step squared.
    np.testing.assert_allclose(dense, numeric(nlp.values), atol=1e-9)
    np.testing.assert_allclose(nlp.gradient(x), numeric(nlp.objective), atol=1e-7)
    weights = np.arange(1.0, nlp.rows + 1.0)

    def slope(at: Floats) -> Floats:
        rows = np.zeros((nlp.rows, nlp.size))
        rows[nlp.jacobian_pattern] = nlp.jacobian(at)
        return (nlp.gradient(at) + weights @ rows)[:3]

    np.testing.assert_allclose(nlp.hessian_matrix(x, weights), numeric(slope)[:, :3], atol=1e-8)


def test_multipliers_by_block_and_back() -> None:
    nlp = working(coordinates("a", [0, 1], [1.0, 1.0], [2.0, 2.0]))
    by_row = np.array([-3.0, 0.0, 0.0, 2.0])
    (block,) = nlp.by_block(by_row)
    np.testing.assert_array_equal(block, [-3.0, 2.0])
    np.testing.assert_array_equal(nlp.from_blocks([block]), by_row)


# --- steps ------------------------------------------------------------------------------------


def test_a_convex_hessian_is_left_alone() -> None:
    hessian = np.array([[2.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(convex(hessian, np.zeros((0, 2))), hessian, atol=1e-14)


def test_curvature_across_binding_rows_is_lifted_and_along_them_kept() -> None:
    hessian = np.diag([-4.0, 3.0])
    model = convex(hessian, np.array([[1.0, 0.0]]))
    assert model[1, 1] == pytest.approx(3.0)
    assert model[0, 0] > 0.0
    nearly_flat = convex(hessian, np.zeros((0, 2)))
    np.testing.assert_allclose(np.linalg.eigvalsh(nearly_flat), [0.01, 3.0], atol=1e-12)


def step_of(nlp: NonlinearProgram, at: Floats, radius: float):  # noqa: ANN201
    iterate = first(nlp, at, radius)
    local = Linearised.at(iterate.working_set().program, iterate.point.values)
    model = local.model(np.zeros(local.working.rows), settling=False)
    return quadratic_step(iterate, local, model, local.values)


def test_a_step_goes_to_the_bottom_of_the_model_within_the_region() -> None:
    step = step_of(program(), start(0.1, -0.2, 0.3), radius=1.0)
    np.testing.assert_allclose(step.move, [-0.1, 0.2, -0.3], atol=1e-8)
    assert step.predicted == pytest.approx(0.07, abs=1e-8)
    short = step_of(program(), start(0.1, -0.2, 0.3), radius=0.15)
    np.testing.assert_allclose(short.move, [-0.1, 0.15, -0.15], atol=1e-8)


def test_a_step_that_cannot_meet_a_row_leaves_the_rest_of_it() -> None:
    step = step_of(program(at_least("a", 0, 1.0)), start(), radius=0.2)
    np.testing.assert_allclose(step.move[0], 0.2, atol=1e-8)
    assert step.left == pytest.approx(0.8, abs=1e-7)


def test_the_kkt_error_forgives_what_a_bound_holds() -> None:
    nlp = replace(program(bottom=(1.0, 0.0, 0.0)), bounds=(np.full(7, -9.0), np.full(7, 0.0)))
    iterate = Iterate.first(nlp, start(), None, 50.0, 0.2)
    local = Linearised.at(iterate.working_set().program, iterate.point.values)
    assert local.kkt_error(np.zeros(0)) == 0.0
    free = Linearised.at(
        first(replace(nlp, bounds=program().bounds), start()).working_set().program, start()
    )
    assert free.kkt_error(np.zeros(0)) == 1.0


def test_stationarity_finds_the_multipliers_that_a_solve_would() -> None:
    row = program(at_least("a", 0, 1.0))
    assert stationarity(row, start(1.0)) == pytest.approx(0.0, abs=1e-9)
    # Where the row binds, the cost's slope along it is left: 0.3 in y.
    assert stationarity(row, start(1.0, 0.3)) == pytest.approx(0.3)
    # A row pushes one way only, and one that does not bind not at all.
    assert stationarity(program(at_most("a", 0, 1.0)), start(1.0)) == pytest.approx(1.0)
    assert stationarity(row, start(1.1)) == pytest.approx(1.1)
    assert stationarity(program(), start(0.5)) == pytest.approx(0.5)


def test_stationarity_forgives_what_bounds_hold_and_equalities_push_both_ways() -> None:
    bounded = replace(program(), bounds=(np.full(7, 0.4), np.full(7, 9.0)))
    assert stationarity(bounded, start(0.4, 0.4, 0.4)) == pytest.approx(0.0, abs=1e-9)
    assert stationarity(bounded, start(0.4, 0.4, 0.5)) == pytest.approx(0.5)
    for side in (-1.0, 1.0):
        equal = program(coordinates("a", [0], [side], [side]))
        assert stationarity(equal, start(side)) == pytest.approx(0.0, abs=1e-9)


# --- the method -------------------------------------------------------------------------------


def test_the_bottom_of_a_bowl_is_found() -> None:
    found = solve(program(bottom=(0.3, -0.4, 0.2)))
    assert found.converged
    np.testing.assert_allclose(found.values[3:6], [0.3, -0.4, 0.2], atol=1e-7)


def test_a_binding_row_has_the_multiplier_that_balances_the_cost() -> None:
    found = solve(program(at_least("a", 0, 1.0)))
    np.testing.assert_allclose(found.values[3:6], [1.0, 0.0, 0.0], atol=1e-7)
    # At x = 1 the gradient is 1; L = f + m (x) is stationary for m = -1.
    np.testing.assert_allclose(found.multipliers[0], [-1.0], atol=1e-6)
    assert found.kkt_error < 1e-7
    assert found.violation < 1e-8


def test_a_curved_row_is_followed_to_its_optimum() -> None:
    sphere = PositionDistance(
        "a", "mm", 1.0, bound(1.0, [0.0]), bound(1.0, [0.0]), np.array([0]), np.zeros((1, 3))
    )
    found = solve(
        program(CandidateConstraints.all_of(sphere), bottom=(0.0, 0.0, 3.0)), start(1.0, 0.1, 0.0)
    )
    assert found.converged
    np.testing.assert_allclose(found.values[3:6], [0.0, 0.0, 1.0], atol=1e-6)


def test_families_that_contradict_each_other_share_the_violation_by_their_weights() -> None:
    rows = (at_least("a", 0, 1.0), at_most("b", 0, -1.0))
    cheap_b = solve(program(*rows, weights={"a": 100.0}))
    assert cheap_b.values[X] == pytest.approx(1.0, abs=1e-4)
    cheap_a = solve(program(*rows, weights={"b": 100.0}))
    assert cheap_a.values[X] == pytest.approx(-1.0, abs=1e-4)
    assert cheap_a.violation == pytest.approx(2.0, abs=1e-3)


def test_one_row_that_cannot_be_had_does_not_excuse_the_others() -> None:
    impossible = coordinates("a", [0, 0, 1], [1.0, -np.inf, 0.5], [np.inf, -1.0, np.inf])
    found = solve(program(impossible, each=("a",), each_penalty=5.0))
    assert found.values[Y] == pytest.approx(0.5, abs=1e-6)


def test_rows_outside_the_working_set_are_found_when_a_step_violates_them() -> None:
    rows = many_rows([-0.5, -0.2, -0.8, -0.1, -0.3], keep=1)
    found = solve(program(rows), start(2.0))
    assert found.values[X] == pytest.approx(0.8, abs=1e-7)
    assert np.flatnonzero(found.multipliers[0]).tolist() == [2]


def test_unknowns_that_are_not_free_stay() -> None:
    nlp = replace(program(bottom=(1.0, 1.0, 1.0)), unknowns=unknowns((X,)))
    found = solve(nlp, start(0.0, 0.25, -0.5))
    np.testing.assert_allclose(found.values, start(1.0, 0.25, -0.5), atol=1e-7)


def test_a_solve_ends_at_its_iterations_or_when_told() -> None:
    far = program(bottom=(30.0, 0.0, 0.0))
    short = solve(far, start(), max_iterations=2)
    assert (short.converged, short.stopped, short.iterations) == (False, False, 2)
    assert "iterations" in short.why
    told = minimise(far, start(), lambda iteration, *_: iteration < 1)
    assert (told.stopped, told.iterations) == (True, 1)
    assert told.why == "stopped by request"


def test_a_gain_too_small_ends_a_feasible_solve() -> None:
    far = program(bottom=(3.0, 0.0, 0.0))
    loose = solve(far, start(), gain_tolerance=1e9, tolerance=0.0)
    assert loose.converged
    assert loose.iterations == 3
    assert "gained less" in loose.why


def test_the_watch_sees_every_iteration() -> None:
    seen: list[tuple[int, float, float]] = []
    minimise(program(at_least("a", 0, 1.0)), start(), lambda *s: seen.append(s) is None)
    assert [s[0] for s in seen] == list(range(len(seen)))
    assert seen[0][2] == 1.0
    assert seen[-1][2] < 1e-8


def test_known_multipliers_at_the_solution_end_at_once() -> None:
    nlp = program(at_least("a", 0, 1.0))
    found = solve(nlp)
    again = minimise(nlp, found.values, lambda *_: True, known=found.multipliers)
    assert again.iterations == 0
    assert again.converged
