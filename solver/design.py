"""The job: a subject and the limits of a rig in, a design out."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from common.errors import CancelledError
from common.progress import CancelToken, NeverCancelled, Progress, ProgressCallback, ignore_progress
from geometry.arrays import Floats, Ints
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from geometry.subject import Subject
from solver.beginnings import classical, searched, searches, why_classical
from solver.coverage.views import judge
from solver.feasibility.contradictions import Hopeless, hopeless
from solver.infeasibility import conflicts, missed
from solver.limits import Limits
from solver.outer_loop import StartResult
from solver.pool import StartJob
from solver.problem import Problem, camera_at
from solver.quality import evaluate
from solver.refinement import optimality_error, refine
from solver.request import Request
from solver.result import NOBODY, Design, Quality, Relaxation, SolverReport, StartReport, Status
from solver.search.bound import bound_of
from solver.search.candidates import Placed, placed
from solver.standing import check_angles, check_places
from solver.starts import kmeans_start
from solver.strategy import Strategy
from solver.workers import Workers

ENGINE = "sequential quadratic programming with exact second derivatives (PIQP)"
_EXPECTED_OUTER_ITERATIONS = 8
_SOLVED = 0.9
"""Fraction of the work at which all starts are solved."""

_REFINEMENT_COST, _HOPELESS_COST = 1.002, 1.03
"""A refinement may cost so much; beyond the second no more points are named to mend it."""

_REFINEMENT_TRIES = 3
_MOST_NAMED = 100


def design(
    subject: Subject,
    camera: Camera,
    limits: Limits,
    *,
    count: int,
    seed: int = 0,
    starts: int = 8,
    fixed: tuple[RigCamera, ...] = (),
    start: tuple[Pose, ...] | None = None,
    workers: int | Workers = 1,
    strategy: Strategy = Strategy.EXCHANGE,
    bound: bool = False,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Design:
    """Place ``count`` cameras so that the subject is measured as exactly as the limits allow.

    ``fixed`` cameras of an existing rig stay where they are and take part. ``start`` gives the
    poses of the first start, about which Eq 8 bounds the cameras. ``strategy`` says where starts
    come from otherwise; where it does not do alone, the report says why. The best feasible one
    wins, worked on by ``workers`` processes, or those that were begun before and end with the
    search; the result does not depend on their number. With ``bound`` a design that holds its
    limits says how good any other could be. When the limits contradict each other the nearest
    network is returned with status ``infeasible`` and the conflicts named. Raises
    :class:`InputError` for orders that cannot be understood and :class:`CancelledError` within a
    second of ``cancel`` being set.
    """
    request = Request(subject, camera, limits, count, seed, starts, fixed, start, strategy)
    check_places(subject, fixed, limits)
    for k, pose in enumerate(start or (), 1):
        check_angles(subject, pose, f"start pose {k}")
    token = cancel or NeverCancelled()
    began = time.monotonic()
    tell = _Teller(progress)
    tell.stage("start", 0.0)
    with Workers(workers) if isinstance(workers, int) else workers as helpers:
        if searches(request):
            helpers.begin()
        with threadpool_limits(1):
            told = hopeless(subject, camera, limits, count + len(fixed))
        if told is not None:
            at_once = _told_at_once(request, told, began)
            if not at_once.feasible:
                tell.stage("done", 1.0)
                return at_once
        solved = _solved(request, helpers, tell, token)
    jobs, results, scores = solved.jobs, solved.results, solved.scores
    tell.stage("choose", _SOLVED)
    best = min(range(len(jobs)), key=lambda k: (*scores[k].rank, k))
    problem = jobs[best].problem
    tell.stage("refine", 0.93)
    values, quality, kkt, why, iterations = _finish(problem, results[best], scores[best], token)
    begin = evaluate(subject, problem.cameras, limits, problem.anchor)
    if best != 0 and start is not None:
        # Another start won; what was given must not be better than that.
        problem, begin = _better_given(jobs[0].problem, problem, begin, quality)
    if begin.rank < quality.rank:
        values, quality, kkt = problem.start_values(), begin, np.nan  # nobody solved there
        why = "no solve found anything better than the start"
    found: tuple[Relaxation, ...] = ()
    if not quality.feasible:
        tell.stage("diagnose", 0.96)
        found = conflicts(problem, values, token)
    if token.is_set():
        raise CancelledError
    cameras = problem.placed(values)
    around = solved.around
    wanted = bound and quality.feasible
    report = SolverReport(
        engine=ENGINE,
        status=_status(quality, kkt),
        why_stopped=why,
        kkt_error=kkt,
        iterations=results[best].iterations + iterations,
        rounds=results[best].rounds,
        seed=seed,
        seconds=time.monotonic() - began,
        starts=tuple(_start_report(j, r, s) for j, r, s in zip(jobs, results, scores, strict=True)),
        conflicts=found,
        starts_note=solved.note,
        bound=bound_of(subject, camera, limits, cameras, token, around) if wanted else None,
    )
    tell.stage("done", 1.0)
    return Design(cameras, quality, problem.cameras, begin, limits, report)


def _told_at_once(request: Request, told: Hopeless, began: float) -> Design:
    """A first network, where no network can hold the limits: given or k-means, not optimised."""
    subject, camera, names = request.subject, request.camera, request.names
    cameras = kmeans_start(subject, camera, request.limits, names, request.seed)
    if request.start is not None:
        poses = zip(names, request.start, strict=True)
        cameras = tuple(camera_at(camera, name, pose, request.target_mm) for name, pose in poses)
    problem = request.problem(cameras)
    quality = evaluate(subject, problem.cameras, request.limits, problem.anchor)
    report = SolverReport(
        engine=NOBODY,
        status=Status.INFEASIBLE,
        why_stopped=f"nothing was searched: {told}",
        kkt_error=np.nan,
        iterations=0,
        rounds=0,
        seed=request.seed,
        seconds=time.monotonic() - began,
        starts=(),
        conflicts=missed(quality, told.families),
        contradiction=str(told),
    )
    return Design(problem.cameras, quality, problem.cameras, quality, request.limits, report)


@dataclass(frozen=True, eq=False)
class _Solved:
    """All starts, what came of each and how it is judged.

    ``note`` why classical starts are among them although others were asked for; ``around`` where
    the search looked, None if nothing was searched.
    """

    jobs: list[StartJob]
    results: list[StartResult]
    scores: list[Quality]
    note: str
    around: Placed | None


def _solved(request: Request, helpers: Workers, tell: _Teller, cancel: CancelToken) -> _Solved:
    """The starts that the strategy makes, and classical ones where it does not do alone."""
    around, jobs = None, []
    if searches(request):
        subject, camera, limits = request.subject, request.camera, request.limits
        around = placed(subject, camera, limits, cancel, workers=helpers)
        jobs = searched(request, around, helpers, cancel)
    tell.expect(0, len(jobs))
    results = helpers.run(jobs, tell.step, cancel)
    scores = _scores(jobs, results, cancel)
    note = why_classical(request, jobs, scores)
    if note is not None:
        more = classical(request, len(jobs), cancel)
        tell.expect(len(jobs), len(more))
        others = helpers.run(more, tell.step, cancel)
        scores += _scores(more, others, cancel)
        jobs, results = jobs + more, results + others
    return _Solved(jobs, results, scores, note or "", around)


class _Teller:
    """Turns the steps of all starts into one fraction that never falls."""

    def __init__(self, progress: ProgressCallback) -> None:
        self._progress = progress
        self._first, self._done = 0, [0.0]
        self._fraction = self._begun = 0.0

    def expect(self, first: int, starts: int) -> None:
        """So many starts are next, the first of them with this index."""
        self._first, self._done = first, [0.0] * starts
        self._begun = self._fraction

    def stage(self, name: str, fraction: float) -> None:
        self._fraction = max(self._fraction, fraction)
        self._progress(Progress(name, self._fraction))

    def step(self, start: int, outer: int, iteration: int, cost: float, violation: float) -> None:
        # How many there will be is not known; a start creeps towards its end without passing it.
        share = 1.0 - np.exp(-2.0 * (outer + iteration / 1e3) / _EXPECTED_OUTER_ITERATIONS)
        at = start - self._first
        self._done[at] = max(self._done[at], float(share))
        done = sum(self._done) / len(self._done)
        self._fraction = max(self._fraction, self._begun + (_SOLVED - self._begun) * done)
        self._progress(Progress("solve", self._fraction, start, iteration, cost, violation))


def _scores(jobs: list[StartJob], results: list[StartResult], cancel: CancelToken) -> list[Quality]:
    """Each result as it is judged: on the check points."""
    out = []
    for job, result in zip(jobs, results, strict=True):
        if cancel.is_set():
            raise CancelledError
        problem = job.problem
        cameras = problem.placed(result.values)
        out.append(evaluate(problem.subject, cameras, problem.limits, problem.anchor))
    return out


def _finish(
    problem: Problem, result: StartResult, quality: Quality, cancel: CancelToken
) -> tuple[Floats, Quality, float, str, int]:
    """Bring the winner to the last digit, unless that would cost it a limit.

    A refinement that loses a point, or views of it that count, is repeated with that point named.
    """
    why = result.why
    for _ in range(_REFINEMENT_TRIES):
        outcome = refine(problem, result, cancel)
        refined = evaluate(
            problem.subject, problem.placed(outcome.values), problem.limits, problem.anchor
        )
        # A sharper optimum of the assigned rays may cost a hair with the rays as they are.
        worth = refined.feasible and refined.cost_mm2 <= _REFINEMENT_COST * quality.cost_mm2
        if worth or refined.rank < quality.rank:
            return outcome.values, refined, outcome.kkt_error, outcome.why, outcome.iterations
        why = f"{result.why}; the last digits with each view held cost more than they give"
        if quality.feasible and refined.cost_mm2 > _HOPELESS_COST * quality.cost_mm2:
            break
        judged = judge(problem, problem.unknowns.state(outcome.values))
        named = np.union1d(judged.missed, _worsened(quality, refined))
        result = result.naming(named, judged.shortfall)
    return result.values, quality, optimality_error(problem, result), why, 0


def _better_given(
    given: Problem, problem: Problem, begin: Quality, found: Quality
) -> tuple[Problem, Quality]:
    """The given start and its quality where it beats what was found; else what is there."""
    quality = evaluate(given.subject, given.cameras, given.limits, given.anchor)
    return (given, quality) if quality.rank < found.rank else (problem, begin)


def _worsened(before: Quality, after: Quality) -> Ints:
    """Check points (k,) whose covariance grew most, at most so many as a solve can hold."""
    grown = after.points.norm_mm2 - before.points.norm_mm2
    worst = np.argsort(-grown, kind="stable")[:_MOST_NAMED]
    return np.asarray(worst[grown[worst] > 0.0])


def _status(quality: Quality, kkt: float) -> Status:
    if not quality.feasible:
        return Status.INFEASIBLE
    return Status.CONVERGED if kkt < 1e-4 else Status.STOPPED


def _start_report(job: StartJob, result: StartResult, quality: Quality) -> StartReport:
    return StartReport(
        index=job.index,
        kind=job.kind,
        feasible=quality.feasible,
        cost_mm2=quality.cost_mm2,
        violation=quality.rank[0],
        iterations=result.iterations,
        rounds=result.rounds,
        why_stopped=result.why,
    )
