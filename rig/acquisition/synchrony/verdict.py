"""One sentence on whether a capture was synchronised, and on what that rests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.capturedata import CaptureData
from rig.acquisition.synchrony.evidence import (
    EdgeEvidence,
    Passed,
    StampEvidence,
    SyncClass,
    against,
    edge_evidence,
    stamp_evidence,
)
from rig.acquisition.synchrony.optical import BoardReader, OpticalEvidence, optical_evidence


class SyncState(StrEnum):
    """What can be said."""

    SYNCHRONISED = "synchronised"
    NOT_SYNCHRONISED = "not-synchronised"
    UNDECIDED = "undecided"
    """The evidence is not fine enough for the limit."""
    UNPROVEN = "unproven"
    """There is no evidence from every camera."""


class Level(StrEnum):
    """The highest level of evidence that covers every camera."""

    NONE = "none"
    EDGES = "A"
    STAMPS = "B"
    OPTICAL = "C"


@dataclass(frozen=True)
class Verdict:
    """``within_us``: all exposures' middles of each shot lie within this, uncertainty included.

    It is NaN when unproven. ``lacking``: what would have to be there for a better level.
    """

    state: SyncState
    level: Level
    within_us: float
    limit_us: float
    text: str
    lacking: tuple[str, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """All three levels and the verdict."""

    edges: EdgeEvidence | None
    stamps: StampEvidence
    optical: OpticalEvidence | None
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class Board:
    """How to read the timing board. ``range_us``: when its counter begins again."""

    read: BoardReader
    range_us: float


def gather(station: Station, captured: CaptureData, board: Board | None = None) -> Evidence:
    """All that a capture proves. ``board`` None: no timing board is looked for."""
    limit = station.policy.skew_limit_us
    edges = edge_evidence(captured)
    stamps = stamp_evidence(captured, limit)
    optical = None
    if board is not None:
        optical = optical_evidence(station, captured, board.read, board.range_us)
    return Evidence(edges, stamps, optical, judge(captured, edges, stamps, optical, limit))


def judge(
    captured: CaptureData,
    edges: EdgeEvidence | None,
    stamps: StampEvidence,
    optical: OpticalEvidence | None,
    limit_us: float,
) -> Verdict:
    """The verdict by the best level that covers every picture that was taken."""
    taken = {(p.plan.name, one.shot) for p in captured.parts for one in p.pairing.pairs}
    lacking = _lacking(captured, stamps, optical)
    if not taken:
        text = "no picture was taken"
        return Verdict(SyncState.UNPROVEN, Level.NONE, math.nan, limit_us, text, lacking)
    if optical is not None and taken == {(r.camera, r.shot) for r in optical.readings}:
        spread = (optical.spread_us, optical.spread_uncertainty_us)
        return _decided(captured, Level.OPTICAL, *spread, limit_us, lacking)
    if taken == {(f.camera, f.shot) for f in stamps.frames if math.isfinite(f.skew_us)}:
        worst = max(stamps.shots, key=lambda s: s.spread_us + s.spread_uncertainty_us)
        spread = (worst.spread_us, worst.spread_uncertainty_us)
        return _decided(captured, Level.STAMPS, *spread, limit_us, lacking)
    return _unproven(edges, stamps, limit_us, lacking)


def _decided(
    captured: CaptureData,
    level: Level,
    spread_us: float,
    uncertainty_us: float,
    limit_us: float,
    lacking: tuple[str, ...],
) -> Verdict:
    cameras, lost = len(captured.parts) + len(captured.absent), sorted(captured.missing())
    if cameras == 1 and not lost:
        text = "one camera alone: there is nothing to be synchronised with"
        return Verdict(SyncState.SYNCHRONISED, level, 0.0, limit_us, text, lacking)
    how = "the timing board" if level is Level.OPTICAL else "the cameras' time stamps"
    passed = against(limit_us, spread_us, uncertainty_us)
    if lost:
        told = _incomplete(captured, how, spread_us, uncertainty_us, lost)
        if passed is Passed.FAIL:
            return Verdict(
                SyncState.NOT_SYNCHRONISED,
                level,
                spread_us + uncertainty_us,
                limit_us,
                f"not synchronised: {told}; the limit is {limit_us:.0f} us",
                lacking,
            )
        # What came in time proves nothing of the cameras that gave no picture.
        return Verdict(
            SyncState.UNPROVEN, Level.NONE, math.nan, limit_us, f"not proven: {told}", lacking
        )
    states = {
        Passed.PASS: (SyncState.SYNCHRONISED, "synchronised"),
        Passed.FAIL: (SyncState.NOT_SYNCHRONISED, "not synchronised"),
        Passed.UNDECIDED: (SyncState.UNDECIDED, "not decided"),
    }
    state, word = states.get(passed or Passed.UNDECIDED, states[Passed.UNDECIDED])
    text = (
        f"{word}: the exposures of all {cameras} cameras lie within {spread_us:.0f} us by {how} "
        f"(+- {uncertainty_us:.0f} us; the limit is {limit_us:.0f} us)"
    )
    return Verdict(state, level, spread_us + uncertainty_us, limit_us, text, lacking)


def _incomplete(
    captured: CaptureData,
    how: str,
    spread_us: float,
    uncertainty_us: float,
    names: Sequence[str],
) -> str:
    """What can be said where cameras lack pictures."""
    cameras = len(captured.parts) + len(captured.absent)
    several = sum(bool(part.pairing.pairs) for part in captured.parts) > 1
    came = (
        f"those that came lie within {spread_us:.0f} us by {how} (+- {uncertainty_us:.0f} us)"
        if several
        else "one camera alone gave any"
    )
    return f"{len(names)} of {cameras} cameras lack pictures ({', '.join(names)}); {came}"


def _unproven(
    edges: EdgeEvidence | None, stamps: StampEvidence, limit_us: float, lacking: tuple[str, ...]
) -> Verdict:
    wired = all(camera.sync_class is SyncClass.HARDWARE for camera in stamps.cameras)
    if wired and edges is not None and math.isfinite(edges.error_us):
        text = (
            f"not proven: the box made its edges to {edges.error_us:.1f} us, but not every camera "
            "says when it exposed"
        )
        return Verdict(SyncState.UNPROVEN, Level.EDGES, math.nan, limit_us, text, lacking)
    text = "not proven: not every camera says when it exposed"
    return Verdict(SyncState.UNPROVEN, Level.NONE, math.nan, limit_us, text, lacking)


def _lacking(
    captured: CaptureData, stamps: StampEvidence, optical: OpticalEvidence | None
) -> tuple[str, ...]:
    missing = []
    if not (captured.report is not None and captured.report.edges):
        missing.append("A: no edge log of a trigger box")
    dumb = sorted({f.camera for f in stamps.frames if not math.isfinite(f.skew_us)})
    if dumb:
        missing.append(f"B: no usable time stamps of {', '.join(dumb)}")
    if optical is None:
        missing.append("C: no timing board was looked for")
    elif optical.unread:
        missing.append(f"C: the timing board was not read by {', '.join(sorted(optical.unread))}")
    return tuple(missing)
