"""Where the cameras of a design begin: the strategies, and the classical starts beside them."""

from __future__ import annotations

import numpy as np

from common.errors import CancelledError
from common.progress import CancelToken
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from geometry.subject import Subject
from solver.limits import Limits
from solver.pool import StartJob
from solver.problem import camera_at
from solver.quality import evaluate
from solver.request import Request
from solver.result import Quality
from solver.search.built import Build, built_network, filtered, next_best_views
from solver.search.candidates import Placed
from solver.search.exchange import search_networks
from solver.starts import kmeans_start, strips, turned
from solver.strategy import Strategy
from solver.workers import Workers

_FINE = 2
"""How many networks of the search are optimised continuously."""

_BUILT: dict[Strategy, Build] = {
    Strategy.NEXT_BEST_VIEW: next_best_views,
    Strategy.FILTERING: filtered,
}


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


def searches(request: Request) -> bool:
    """Whether networks are searched: not about given poses, nor where it would help nothing."""
    if request.limits.matching.required and request.strategy is not Strategy.STRIP:
        # The classical starts know nothing of what can be matched.
        return request.start is None
    asked = request.start is None and not request.strategy.classical
    return asked and not unknown_to_search(request.limits)


def why_classical(request: Request, jobs: list[StartJob], scores: list[Quality]) -> str | None:
    """Why given or classical starts are to be tried, "" where they are asked for; None if not."""
    unknown = ", ".join(unknown_to_search(request.limits))
    ignorant = f"the search does not know some of the limits ({unknown})"
    if not searches(request):
        asked = request.start is not None or request.strategy.classical
        return "" if asked else f"{ignorant}, so the classical starts were tried instead"
    tried = "so the classical starts were tried as well"
    if not jobs:
        return f"the search found no network that keeps the rules about pairs of cameras, {tried}"
    if not any(s.feasible for s in scores):
        return f"no network of the search could be moved to where all limits hold, {tried}"
    return f"{ignorant}, {tried}" if unknown else None


def searched(
    request: Request, around: Placed, helpers: Workers, cancel: CancelToken
) -> list[StartJob]:
    """The best networks of the search among the candidates ``around`` the subject."""
    build = _BUILT.get(request.strategy)
    if build is None:
        kind, found = Strategy.EXCHANGE, search_networks(request, around, cancel, helpers)
    else:
        kind, found = request.strategy, built_network(request, around, cancel, build)
    if cancel.is_set():
        raise CancelledError
    return [
        StartJob(k, kind.value, request.problem(cameras), request.seed, near=True)
        for k, cameras in enumerate(found[: min(_FINE, request.starts)])
    ]


def classical(request: Request, first: int, cancel: CancelToken) -> list[StartJob]:
    """The given or the k-means start, the best strip, then jittered k-means starts; or strips."""
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
                camera_at(camera, n, turned(p, limits), request.target_mm)
                for n, p in zip(names, request.start, strict=True)
            ),
        )
        while len(jobs) < request.starts:
            add("given, jittered", _jittered(request, len(jobs)))
        return jobs
    if request.strategy is Strategy.STRIP and len(names) > 1:
        for cameras in _best_strips(subject, camera, limits, names)[: request.starts]:
            add("strip", cameras)
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


def _jittered(request: Request, index: int) -> tuple[RigCamera, ...]:
    """The given poses, each turned by about 6 degrees and moved by 10 % of its distance."""
    rng = np.random.default_rng([request.seed, index])
    out = []
    for name, pose in zip(request.names, request.start or (), strict=True):
        distance = float(np.linalg.norm(pose.position_rig_mm - request.target_mm))
        position = pose.position_rig_mm + 0.1 * distance * rng.normal(size=3)
        angles = pose.omega_phi_kappa_deg + 6.0 * rng.normal(size=3)
        out.append(
            camera_at(
                request.camera,
                name,
                turned(Pose.from_omega_phi_kappa(position, angles), request.limits),
                request.target_mm,
            )
        )
    return tuple(out)


def best_strip(
    subject: Subject, camera: Camera, limits: Limits, names: tuple[str, ...]
) -> tuple[RigCamera, ...]:
    """The conventional strip that meets the limits best, and at the least cost among those."""
    return _best_strips(subject, camera, limits, names)[0]


def _best_strips(
    subject: Subject, camera: Camera, limits: Limits, names: tuple[str, ...]
) -> list[tuple[RigCamera, ...]]:
    options = strips(subject, camera, limits, names)
    return sorted(options, key=lambda cameras: evaluate(subject, cameras, limits).rank)
