"""Targets in the pictures of many cameras: from files to observations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from calibration.detection.detections import Detections, PictureProblem
from calibration.detection.finding import find_targets
from calibration.detection.gates import Gates, Rule
from calibration.detection.images import read_picture
from calibration.detection.opencv import AnyImage
from calibration.detection.selftest import require_opencv
from calibration.detection.unseen import (
    LEAST,
    MIRRORED,
    UNPAIRED,
    LeaveOut,
    Look,
    unpaired,
    unseeing,
)
from calibration.observations import Observations
from calibration.targets.kinds import TargetPlan
from common.errors import InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)

_POLL_S = 0.1
_MISPLACED = (Rule.FIT, Rule.HOMOGRAPHY, Rule.POSE)
_MANY = 0.2
"""Share of targets that is worth a sentence when it is lost."""
_MIRRORED = (
    "{camera} sees the targets in a mirror only and was left out: it looks at the back of a plate "
    "(then give back_mm, the plate's thickness, in the target file), or its pictures are flipped "
    "(then switch that off and take them again)."
)


@dataclass(frozen=True, eq=False)
class TakenPicture:
    """One picture: by which camera, in which frame, as a file or an array as detection takes it."""

    camera: str
    frame: str
    image: Path | AnyImage

    @property
    def name(self) -> str:
        """What to call it in a message."""
        if isinstance(self.image, Path):
            # Pictures of one frame have one name: only the folder tells them apart.
            return f"{self.image.parent.name}/{self.image.name}"
        return f"the picture of {self.camera} in frame {self.frame}"


@dataclass(frozen=True, eq=False)
class DetectedPictures:
    """What was found: ``detections`` belong to ``pictures``, one each, in order.

    ``problems``: the cameras of which no observation is used, and why.
    """

    observations: Observations
    pictures: tuple[TakenPicture, ...]
    detections: tuple[Detections, ...]
    problems: Mapping[str, PictureProblem] = field(default_factory=dict)

    @property
    def left_out(self) -> tuple[str, ...]:
        """A sentence for each camera that sees the targets in a mirror only."""
        found = (name for name, problem in self.problems.items() if problem.code == MIRRORED)
        return tuple(_MIRRORED.format(camera=name) for name in found)

    def counts(self) -> dict[str, int]:
        """Targets found by each camera in all its pictures."""
        total = dict.fromkeys((picture.camera for picture in self.pictures), 0)
        for picture, found in zip(self.pictures, self.detections, strict=True):
            total[picture.camera] += len(found)
        return total

    def thrown_out(self) -> tuple[str, ...]:
        """A sentence for each camera of whose targets many did not pass the gates."""
        lost: dict[str, Counter[str]] = {name: Counter() for name in self.observations.cameras}
        for picture, found in zip(self.pictures, self.detections, strict=True):
            rules = (r.rule.value for r in found.rejections if r.rule in _MISPLACED)
            if picture.camera in lost:
                lost[picture.camera].update(rules)
        counts, sentences = self.counts(), []
        for camera, by_rule in lost.items():
            share = by_rule.total() / max(by_rule.total() + counts[camera], 1)
            if share > _MANY:
                sentences.append(
                    f"{share:.0%} of the targets that {camera} saw were not used, most by rule "
                    f"{by_rule.most_common(1)[0][0]}."
                )
        return tuple(sentences)


@dataclass(frozen=True, eq=False)
class DetectionJob:
    """Detection in one picture, to be called in this or another process."""

    picture: TakenPicture
    plan: TargetPlan
    gates: Gates
    explain: bool = False

    def __call__(self) -> Detections:
        """Read the picture and find the targets; errors name the picture."""
        image = self.picture.image
        if not isinstance(image, Path):
            try:
                return find_targets(image, self.plan, self.gates, self.explain)
            except InputError as error:
                problem = error.problem.replace("the picture", self.picture.name, 1)
                raise InputError(error.detail, problem, error.remedy) from error
        picture = read_picture(image, self.picture.name)
        return find_targets(picture, self.plan, self.gates, self.explain)


def detect_pictures(
    pictures: Sequence[TakenPicture],
    plan: TargetPlan,
    *,
    gates: Gates | None = None,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
    executor: Executor | None = None,
    leave_out: LeaveOut = LeaveOut.NONE,
) -> DetectedPictures:
    """Targets in all pictures. Cameras and frames keep the order in which they first come.

    Work goes to ``executor`` when there is one (jobs and results can be pickled), else it is
    done here. ``leave_out``: which cameras are left out and told where their pictures cannot be
    used, as long as two others are left.

    Raises :class:`CancelledError`, and one-line :class:`InputError` for: no pictures,
    two of one camera and frame, a picture that cannot be read, pictures of one camera in
    different sizes, and a camera that is not left out though it shares no name of a picture with
    another or saw no target at all, with the reason where it is known.
    Raises :class:`DeviceError` when this OpenCV measures wrongly.
    """
    gates = Gates() if gates is None else gates
    _check_list(pictures)
    problems = _unpaired(pictures)
    if not any(carrier.fixed for carrier in plan.target_set().carriers):
        _refuse(pictures, problems, leave_out)
    require_opencv()
    jobs = [DetectionJob(picture, plan, gates) for picture in pictures]
    found: list[Detections] = []
    stop = cancel or NeverCancelled()
    for number, result in enumerate(_results(jobs, stop, executor), 1):
        _check_size(pictures, found, result)
        found.append(result)
        progress(Progress("finding targets", number / len(jobs), iteration=number))
    problems = _moving(problems, pictures, found, plan)
    looks = [
        Look(p.camera, d, replace(j, explain=True))
        for p, d, j in zip(pictures, found, jobs, strict=True)
    ]
    problems = unseeing(looks, plan, leave_out, stop) | problems
    _refuse(pictures, problems, leave_out)
    rows = [k for k, p in enumerate(pictures) if p.camera not in problems]
    observations = _observations([pictures[k] for k in rows], [found[k] for k in rows], plan)
    return DetectedPictures(observations, tuple(pictures), tuple(found), problems)


def _results(
    jobs: Sequence[DetectionJob], cancel: CancelToken, executor: Executor | None
) -> Iterator[Detections]:
    if executor is None:
        for job in jobs:
            go_on(cancel)
            yield job()
        return
    futures = [executor.submit(job) for job in jobs]
    try:
        for future in futures:
            yield _awaited(future, cancel)
    finally:
        for future in futures:
            future.cancel()


def _awaited(future: Future[Detections], cancel: CancelToken) -> Detections:
    while True:
        go_on(cancel)
        try:
            return future.result(_POLL_S)
        except TimeoutError:
            continue


def _check_list(pictures: Sequence[TakenPicture]) -> None:
    if not pictures:
        raise InputError("pictures-none", "there are no pictures", "give at least one per camera")
    taken = Counter((p.camera, p.frame) for p in pictures)
    (camera, frame), count = taken.most_common(1)[0]
    if count > 1:
        raise InputError(
            "pictures-twice",
            f"there are {count} pictures of camera {camera} in frame {frame}",
            "give one picture of each camera in each frame",
        )


def _check_size(
    pictures: Sequence[TakenPicture], found: Sequence[Detections], result: Detections
) -> None:
    this = pictures[len(found)]
    for other, earlier in zip(pictures, found, strict=False):
        if other.camera == this.camera and earlier.image_size_px != result.image_size_px:
            raise InputError(
                "pictures-sizes",
                f"{this.name} has {_text(result)} pixels, {other.name} of the same camera "
                f"{this.camera} has {_text(earlier)}",
                "give pictures of one size and orientation for each camera",
            )


def _text(found: Detections) -> str:
    return "{} x {}".format(*found.image_size_px)


def _unpaired(pictures: Sequence[TakenPicture]) -> dict[str, PictureProblem]:
    cameras = dict.fromkeys(p.camera for p in pictures)
    return unpaired({c: frozenset(p.frame for p in pictures if p.camera == c) for c in cameras})


def _moving(
    problems: Mapping[str, PictureProblem],
    pictures: Sequence[TakenPicture],
    found: Sequence[Detections],
    plan: TargetPlan,
) -> dict[str, PictureProblem]:
    """The problems of cameras that see what moves: what stands still needs no pairs."""
    ids = {i for c in plan.target_set().carriers if not c.fixed for i in c.ids}
    see = {p.camera for p, d in zip(pictures, found, strict=True) if not ids.isdisjoint(d.ids)}
    return {camera: problem for camera, problem in problems.items() if camera in see}


def _refuse(
    pictures: Sequence[TakenPicture], problems: Mapping[str, PictureProblem], leave_out: LeaveOut
) -> None:
    """Raises for the first camera that cannot be left out."""
    cameras = dict.fromkeys(p.camera for p in pictures)
    enough = len(cameras) - len(problems) >= LEAST
    for camera, problem in problems.items():
        if enough and leave_out.leaves(problem):
            continue
        if problem.code == UNPAIRED:
            raise InputError("pictures-unpaired", problem.problem, problem.remedy)
        raise problem.error(f"camera {camera}")


def _observations(
    pictures: Sequence[TakenPicture], found: Sequence[Detections], plan: TargetPlan
) -> Observations:
    targets = plan.target_set()
    cameras = tuple(dict.fromkeys(p.camera for p in pictures))
    frames = tuple(dict.fromkeys(p.frame for p in pictures))
    sizes = {p.camera: d.image_size_px for p, d in zip(pictures, found, strict=True)}
    order = {name: k for k, name in enumerate(targets.ids)}
    counts = [len(d) for d in found]
    return Observations(
        targets,
        cameras,
        np.array([sizes[c] for c in cameras], dtype=np.int64),
        frames,
        np.repeat([cameras.index(p.camera) for p in pictures], counts),
        np.repeat([frames.index(p.frame) for p in pictures], counts),
        np.array([order[i] for d in found for i in d.ids], dtype=np.int64),
        np.concatenate([d.pixel for d in found]),
        np.concatenate([d.sigma_px for d in found]),
        np.concatenate([d.blur_px for d in found]),
    )
