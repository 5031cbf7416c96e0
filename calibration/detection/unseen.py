"""Cameras whose pictures cannot be used, and why: they show nothing, are mirrored, or unpaired."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from calibration.detection.detections import Detections, PictureProblem
from calibration.detection.diagnosis import FEW
from calibration.targets.kinds import TargetPlan
from common.progress import CancelToken, go_on

UNPAIRED = "unpaired"
MIRRORED = "mirrored"
LEAST = 2
"""Cameras that must be left for the others to be left out."""

_EXPLAINED = 3


class LeaveOut(StrEnum):
    """Which cameras whose pictures cannot be used are left out and told; the others are refused."""

    NONE = "none"
    MIRRORED = "mirrored"
    ALL = "all"

    def leaves(self, problem: PictureProblem) -> bool:
        """Whether a camera with this problem is left out."""
        return self is LeaveOut.ALL or (self is LeaveOut.MIRRORED and problem.code == MIRRORED)


@dataclass(frozen=True, eq=False)
class Look:
    """What was found in one picture, and how to ask why it is so little."""

    camera: str
    found: Detections
    explain: Callable[[], Detections]


def unpaired(frames: Mapping[str, frozenset[str]]) -> dict[str, PictureProblem]:
    """Cameras that share the name of no picture with another; ``frames`` are the names of each."""
    out: dict[str, PictureProblem] = {}
    if len(frames) < LEAST:
        return out
    remedy = "rename them"
    counts = {len(names) for names in frames.values()}
    if len(counts) == 1:
        remedy += f" (every camera has {counts.pop()}: in their order they would pair)"
    for camera, names in frames.items():
        if not any(names & others for other, others in frames.items() if other != camera):
            out[camera] = PictureProblem(
                UNPAIRED,
                f"no picture of {camera} has the name of another camera's picture: pictures of "
                "one instant must have one name",
                remedy,
            )
    return out


def unseeing(
    looks: Sequence[Look], plan: TargetPlan, leave_out: LeaveOut, cancel: CancelToken
) -> dict[str, PictureProblem]:
    """Cameras that show no target, or see them in a mirror, and why.

    Ends with the first that is not left out. Raises :class:`CancelledError` when told to stop.
    """
    out: dict[str, PictureProblem] = {}
    for camera in dict.fromkeys(look.camera for look in looks):
        mine = [look for look in looks if look.camera == camera]
        go_on(cancel)
        best = max(mine, key=lambda look: len(look.found))
        problem = _mirrored(best, plan) if len(best.found) else _nothing(mine, plan, cancel)
        if problem is not None:
            out[camera] = problem
            if not leave_out.leaves(problem):
                break
    return out


def _mirrored(best: Look, plan: TargetPlan) -> PictureProblem | None:
    """Few targets in a camera's best picture may be those that look the same in a mirror."""
    if len(best.found) > min(FEW, len(plan.target_set().ids) // 2):
        return None
    return next((f for f in best.explain().findings if f.code == MIRRORED), None)


def _nothing(mine: Sequence[Look], plan: TargetPlan, cancel: CancelToken) -> PictureProblem:
    # A picture with rejections shows more than one without, and explains better.
    for look in sorted(mine, key=lambda look: -len(look.found.rejections))[:_EXPLAINED]:
        go_on(cancel)
        findings = look.explain().findings
        if findings:
            return findings[0]
    rejected = Counter(r.rule.value for look in mine for r in look.found.rejections)
    seen = ""
    if rejected:
        rule = rejected.most_common(1)[0][0]
        seen = f"; {sum(rejected.values())} were rejected, most by rule {rule}"
    return PictureProblem(
        "none",
        f"it shows no target of set {plan.name!r} in its {len(mine)} pictures{seen}",
        "check that the targets are in view, sharp and well lit, and that the target file is "
        "theirs",
    )
