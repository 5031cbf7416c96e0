"""The job: a subject and the limits of a rig in, a design out."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.errors import CancelledError, InputError
from common.progress import CancelToken, NeverCancelled, Progress, ProgressCallback, ignore_progress
from geometry.arrays import Floats, Ints
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from geometry.subject import Subject
from solver.coverage.views import judge
from solver.feasibility.contradictions import Hopeless, hopeless
from solver.infeasibility import conflicts, missed
from solver.limits import Limits
from solver.outer_loop import StartResult
from solver.pool import StartJob, run_all
from solver.problem import Problem, camera_at
from solver.quality import evaluate
from solver.refinement import optimality_error, refine
from solver.result import NOBODY, Design, Quality, Relaxation, SolverReport, StartReport, Status
from solver.search.exchange import search_networks
from solver.standing import check_angles, check_places
from solver.starts import kmeans_start, strips, turned
from solver.strategy import Strategy

ENGINE = "sequential quadratic programming with exact second derivatives (PIQP)"
_EXPECTED_OUTER_ITERATIONS = 8
_SOLVED = 0.9
"""Fraction of the work at which all starts are solved."""

_FINE = 2
"""How many networks of the search are optimised continuously."""

_REFINEMENT_COST, _HOPELESS_COST = 1.01, 1.03
"""A refinement may cost the first; beyond the second no more points are named to mend it."""

_REFINEMENT_TRIES = 3
_MOST_NAMED = 100


@dataclass(frozen=True, eq=False)
class Request:
    """What is to be designed. See :func:`design` for the fields."""

    subject: Subject
    camera: Camera
    limits: Limits
    count: int
    seed: int
    starts: int
    fixed: tuple[RigCamera, ...]
    start: tuple[Pose, ...] | None
    strategy: Strategy

    def __post_init__(self) -> None:
        total = self.count + len(self.fixed)
        views = max((t.views for t in self.limits.coverage.tiers), default=1)
        given = None if self.start is None else len(self.start)
        problems = (
            (
                self.count < 1,
                "no-cameras",
                f"{self.count} cameras are to be placed",
                "ask for at least one",
            ),
            (
                self.starts < 1,
                "starts",
                f"{self.starts} starts are asked for",
                "ask for at least one start",
            ),
            (
                views > total,
                "limits-contradict",
                f"coverage asks for {views} views of each point, but there are {total} cameras",
                "ask for fewer views or more cameras",
            ),
            (
                given is not None and given != self.count,
                "start-count",
                f"{given} start poses are given for {self.count} cameras",
                "give one start pose per camera",
            ),
        )
        for wrong, detail, problem, remedy in problems:
            if wrong:
                raise InputError(detail, problem, remedy)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras to be placed: cam01, cam02, ..., passing over fixed ones."""
        taken = {c.name for c in self.fixed}
        fresh = (f"cam{k:02d}" for k in range(1, self.count + len(taken) + 1))
        return tuple(n for n in fresh if n not in taken)[: self.count]

    @property
    def anchor(self) -> tuple[Pose, ...] | None:
        """Poses about which Eq 8 bounds the cameras; without given ones, each start's own."""
        if self.start is None:
            return None
        return (*(c.pose for c in self.fixed), *self.start)

    def problem(self, cameras: tuple[RigCamera, ...]) -> Problem:
        """The problem that starts from these cameras."""
        everyone = (*self.fixed, *cameras)
        anchor = self.anchor or tuple(c.pose for c in everyone)
        return Problem(self.subject, everyone, self.limits, anchor)


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
    workers: int = 1,
    strategy: Strategy = Strategy.EXCHANGE,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Design:
    """Place ``count`` cameras so that the subject is measured as exactly as the limits allow.

    ``fixed`` cameras of an existing rig stay where they are and take part. ``start`` gives the
    poses of the first start, about which Eq 8 bounds the cameras. ``strategy`` says where starts
    come from otherwise; where it does not do alone, the report says why. The best feasible one
    wins, worked on by ``workers`` processes; the result does not depend on their number. When the
    limits contradict each other the nearest network is returned with status ``infeasible`` and the
    conflicts named. Raises :class:`InputError` for orders that cannot be understood and
    :class:`CancelledError` within a second of ``cancel`` being set.
    """
    request = Request(subject, camera, limits, count, seed, starts, fixed, start, strategy)
    check_places(subject, fixed, limits)
    for k, pose in enumerate(start or (), 1):
        check_angles(subject, pose, f"start pose {k}")
    token = cancel or NeverCancelled()
    began = time.monotonic()
    tell = _Teller(progress)
    tell.stage("start", 0.0)
    with threadpool_limits(1):
        told = hopeless(subject, camera, limits, count + len(fixed))
    if told is not None:
        at_once = _told_at_once(request, told, began)
        if not at_once.feasible:
            tell.stage("done", 1.0)
            return at_once
    jobs = _searched_jobs(request, token)
    tell.expect(0, len(jobs))
    results = run_all(jobs, workers, tell.step, token) if jobs else []
    scores = _scores(jobs, results, token)
    note = _why_classical(request, jobs, scores)
    if note is not None:
        more = _jobs(request, len(jobs), token)
        tell.expect(len(jobs), len(more))
        others = run_all(more, workers, tell.step, token)
        scores += _scores(more, others, token)
        jobs, results = jobs + more, results + others
    tell.stage("choose", _SOLVED)
    best = min(range(len(jobs)), key=lambda k: (*_rank(scores[k]), k))
    problem = jobs[best].problem
    tell.stage("refine", 0.93)
    values, quality, kkt, why, iterations = _finish(problem, results[best], scores[best], token)
    begin = evaluate(subject, problem.cameras, limits, problem.anchor)
    if best != 0 and start is not None:
        # Another start won; what was given must not be better than that.
        problem, begin = _better_given(jobs[0].problem, problem, begin, quality)
    if _rank(begin) < _rank(quality):
        values, quality, kkt = problem.start_values(), begin, np.nan  # nobody solved there
        why = "no solve found anything better than the start"
    found: tuple[Relaxation, ...] = ()
    if not quality.feasible:
        tell.stage("diagnose", 0.96)
        found = conflicts(problem, values, token)
    if token.is_set():
        raise CancelledError
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
        starts_note=note or "",
    )
    tell.stage("done", 1.0)
    return Design(problem.placed(values), quality, problem.cameras, begin, limits, report)


def _told_at_once(request: Request, told: Hopeless, began: float) -> Design:
    """A first network, where no network can hold the limits: given or k-means, not optimised."""
    subject, camera, names = request.subject, request.camera, request.names
    placed = kmeans_start(subject, camera, request.limits, names, request.seed)
    if request.start is not None:
        poses = zip(names, request.start, strict=True)
        placed = tuple(camera_at(camera, name, pose, _target(subject)) for name, pose in poses)
    problem = request.problem(placed)
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


def unknown_to_search(limits: Limits) -> tuple[str, ...]:
    """What decides where cameras stand and the search among candidates does not heed, by name."""
    ratio = limits.base_height
    given = {
        "spacing": limits.spacing,
        "symmetry": limits.symmetry,
        "bounds about a start": limits.bounds,
        "mean incidence": limits.incidence.mean_max_deg,
        "mean base/height": ratio.mean_min if ratio.mean_max is None else ratio.mean_max,
    }
    return tuple(name for name, limit in given.items() if limit is not None)


def _searches(request: Request) -> bool:
    """Whether networks are searched: not about given poses, nor where it would help nothing."""
    if request.limits.matching.required:
        # The classical starts know nothing of what can be matched.
        return request.start is None
    asked = request.start is None and request.strategy is Strategy.EXCHANGE
    return asked and not unknown_to_search(request.limits)


def _why_classical(request: Request, jobs: list[StartJob], scores: list[Quality]) -> str | None:
    """Why given or classical starts are to be tried, "" where they are asked for; None if not."""
    unknown = ", ".join(unknown_to_search(request.limits))
    ignorant = f"the search does not know some of the limits ({unknown})"
    if not _searches(request):
        asked = request.start is not None or request.strategy is Strategy.K_MEANS
        return "" if asked else f"{ignorant}, so the classical starts were tried instead"
    tried = "so the classical starts were tried as well"
    if not jobs:
        return f"the search found no network that keeps the rules about pairs of cameras, {tried}"
    if not any(s.feasible for s in scores):
        return f"no network of the search could be moved to where all limits hold, {tried}"
    return f"{ignorant}, {tried}" if unknown else None


def _searched_jobs(request: Request, cancel: CancelToken) -> list[StartJob]:
    """The best networks of the search among candidates, unless poses to start from are given."""
    if not _searches(request):
        return []
    found = search_networks(
        request.subject,
        request.camera,
        request.limits,
        request.names,
        request.fixed,
        request.seed,
        cancel,
    )
    if cancel.is_set():
        raise CancelledError
    return [
        StartJob(k, "exchange", request.problem(cameras), request.seed, near=True)
        for k, cameras in enumerate(found[: min(_FINE, request.starts)])
    ]


def _jobs(request: Request, first: int, cancel: CancelToken) -> list[StartJob]:
    """The given or the k-means start, the best strip, then jittered k-means starts."""
    subject, camera, limits, names = request.subject, request.camera, request.limits, request.names
    jobs: list[StartJob] = []

    def add(kind: str, cameras: tuple[RigCamera, ...]) -> None:
        if cancel.is_set():
            raise CancelledError
        jobs.append(StartJob(first + len(jobs), kind, request.problem(cameras), request.seed))

    if request.start is not None:
        add(
            "given",
            tuple(
                camera_at(camera, n, turned(p, limits), _target(subject))
                for n, p in zip(names, request.start, strict=True)
            ),
        )
        while len(jobs) < request.starts:
            add("given, jittered", _jittered(request, len(jobs)))
        return jobs
    add("k-means", kmeans_start(subject, camera, limits, names, request.seed))
    if request.starts > 1 and len(names) > 1:
        add("strip", best_strip(subject, camera, limits, names))
    while len(jobs) < request.starts:
        index = len(jobs)
        add(
            "k-means, jittered",
            kmeans_start(subject, camera, limits, names, request.seed + 1000 * index, 1.0),
        )
    return jobs


def _target(subject: Subject) -> Floats:
    return subject.design_points.centroid_mm


def _jittered(request: Request, index: int) -> tuple[RigCamera, ...]:
    """The given poses, each turned by about 6 degrees and moved by 10 % of its distance."""
    rng = np.random.default_rng([request.seed, index])
    out = []
    for name, pose in zip(request.names, request.start or (), strict=True):
        distance = float(np.linalg.norm(pose.position_rig_mm - _target(request.subject)))
        position = pose.position_rig_mm + 0.1 * distance * rng.normal(size=3)
        angles = pose.omega_phi_kappa_deg + 6.0 * rng.normal(size=3)
        out.append(
            camera_at(
                request.camera,
                name,
                turned(Pose.from_omega_phi_kappa(position, angles), request.limits),
                _target(request.subject),
            )
        )
    return tuple(out)


def best_strip(
    subject: Subject, camera: Camera, limits: Limits, names: tuple[str, ...]
) -> tuple[RigCamera, ...]:
    """The conventional strip that meets the limits best, and at the least cost among those."""
    options = strips(subject, camera, limits, names)
    return min(options, key=lambda cameras: _rank(evaluate(subject, cameras, limits)))


def _rank(quality: Quality) -> tuple[float, float]:
    """Feasible before infeasible by relative violation, then by cost."""
    violation = sum(max(0.0, -r.slack) / max(abs(r.limit), 1e-3) for r in quality.violated)
    return violation, quality.cost_mm2


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
        if worth or _rank(refined) < _rank(quality):
            return outcome.values, refined, outcome.kkt_error, outcome.why, outcome.iterations
        why = f"{result.why}; the last digits with each view held cost more than they give"
        if refined.feasible and refined.cost_mm2 > _HOPELESS_COST * quality.cost_mm2:
            break
        judged = judge(problem, problem.unknowns.state(outcome.values))
        result = replace(
            result,
            added_points=np.unique(
                np.concatenate([result.added_points, judged.missed, _worsened(quality, refined)])
            ),
            margins=result.margins.wider(judged.shortfall),
        )
    return result.values, quality, optimality_error(problem, result), why, 0


def _better_given(
    given: Problem, problem: Problem, begin: Quality, found: Quality
) -> tuple[Problem, Quality]:
    """The given start and its quality where it beats what was found; else what is there."""
    quality = evaluate(given.subject, given.cameras, given.limits, given.anchor)
    return (given, quality) if _rank(quality) < _rank(found) else (problem, begin)


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
        violation=_rank(quality)[0],
        iterations=result.iterations,
        rounds=result.rounds,
        why_stopped=result.why,
    )
