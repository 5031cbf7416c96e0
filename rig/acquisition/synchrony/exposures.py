"""Distinct exposures of one camera, and which shot each was made for.

Windows of two shots may overlap: a command that took long may have been carried out early or late.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.synchrony.cameraframes import CameraFrames, Method, Pair
from rig.acquisition.synchrony.clocks import DeviceClock
from rig.acquisition.synchrony.faults import Fault, FaultKind

SAME_EXPOSURE_NS = 1000
"""Stamps nearer than this are of one exposure: no camera exposes twice within a microsecond."""

RANK = {FrameStatus.OK: 0, FrameStatus.LATE: 1, FrameStatus.INCOMPLETE: 2}


@dataclass(frozen=True, eq=False)
class Exposure:
    """One exposure, however often its picture was delivered; ``at_host_ns`` where known."""

    frame: Frame
    copies: int
    at_host_ns: int | None
    uncertainty_us: float = float("inf")

    @property
    def time_ns(self) -> int:
        """The start of an exposure whose start is known."""
        return self.at_host_ns if self.at_host_ns is not None else 0


def distinct_exposures(received: CameraFrames) -> tuple[list[Exposure], list[Fault]]:
    """Each exposure once, in the order in which they came; a fault for each that came twice."""
    groups: list[list[Frame]] = []
    for frame in received.frames:
        group = next((g for g in groups if _same_exposure(g[0], frame)), None)
        if group is None:
            groups.append([frame])
        else:
            group.append(frame)
    exposures = [_exposure(received.clock, group) for group in groups]
    twice = [e for e in exposures if e.copies > 1]
    faults = [
        Fault(
            FaultKind.DUPLICATE,
            f"{received.camera}: one picture was delivered {e.copies} times; one is kept",
            received.camera,
        )
        for e in twice
    ]
    return exposures, faults


def _exposure(clock: DeviceClock | None, group: Sequence[Frame]) -> Exposure:
    best, stamp = min(group, key=lambda f: RANK[f.status]), group[0].device_ns
    if clock is None or stamp is None:
        return Exposure(best, len(group), None)
    return Exposure(best, len(group), clock.host_ns(stamp), clock.uncertainty_us(stamp))


def _same_exposure(a: Frame, b: Frame) -> bool:
    if a.device_ns is not None and b.device_ns is not None:
        return abs(a.device_ns - b.device_ns) < SAME_EXPOSURE_NS
    return a.counter is not None and a.counter == b.counter


Hits = Sequence[Sequence[Exposure]]
"""Shot by shot, in order, the exposures that lie where it may have made one."""


def choose(received: CameraFrames, hits: Hits) -> tuple[list[Pair], list[Fault]]:
    """The pairs that nothing else explains, and a fault for each shot that may have several.

    A camera exposes in the order of its shots: where shots share their candidates and there are
    as many of these as shots, each has its own. Where there are more or fewer, only a candidate
    and a shot that have nobody else are paired.
    """
    pairs, faults = [], []
    for together in _clusters(hits):
        candidates = {id(e): e for k in together for e in hits[k]}
        ordered = sorted(candidates.values(), key=lambda e: e.time_ns)
        chosen = dict(zip(together, ordered, strict=False))
        in_order = len(ordered) == len(together) and all(
            any(e is other for other in hits[k]) for k, e in chosen.items()
        )
        if not in_order:
            chosen = _alone(hits, together)
        for k in together:
            shot = received.trigger_times[k].shot
            if k in chosen:
                e = chosen[k]
                of_clock = (e.at_host_ns, e.uncertainty_us)
                pairs.append(Pair(shot, e.frame, Method.TIMESTAMP, *of_clock))
            else:
                faults.append(_unclear(received, shot, len(hits[k])))
    return sorted(pairs, key=lambda one: one.shot), faults


def _clusters(hits: Hits) -> list[list[int]]:
    """Positions of shots that share candidates, each group in order; those with none are left."""
    groups: list[tuple[list[int], set[int]]] = []
    for k, hit in enumerate(hits):
        positions, shared = [k], {id(e) for e in hit}
        # Shots are in order, and so are their windows: only the last group can share anything.
        if groups and groups[-1][1] & shared:
            before = groups.pop()
            positions, shared = [*before[0], k], before[1] | shared
        if shared:
            groups.append((positions, shared))
    return [positions for positions, _ in groups]


def _alone(hits: Hits, together: Sequence[int]) -> dict[int, Exposure]:
    users = [id(e) for k in together for e in hits[k]]
    return {
        k: hits[k][0] for k in together if len(hits[k]) == 1 and users.count(id(hits[k][0])) == 1
    }


def _unclear(received: CameraFrames, shot: int, count: int) -> Fault:
    if count > 1:
        text = (
            f"{received.camera}: {count} exposures were made about shot {shot}; which one it "
            "fired cannot be told"
        )
    else:
        text = (
            f"{received.camera}: the exposure about shot {shot} may be of a shot beside it, which "
            "followed too fast to tell them apart by its lag"
        )
    return Fault(FaultKind.AMBIGUOUS, text, received.camera, shot)
