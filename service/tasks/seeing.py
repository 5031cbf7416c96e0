"""Finds the targets in a task's pictures, wherever those come from."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from calibration.detection.gates import Rejection
from calibration.detection.pictures import DetectedPictures, TakenPicture, detect_pictures
from calibration.detection.selftest import require_opencv
from calibration.detection.unseen import LeaveOut
from calibration.targets.kinds import TargetPlan
from common.files.plain import plain
from common.progress import Progress, within
from service.jobs.engine import Running, Task
from service.kinds.base import RequestT, ResultT
from service.kinds.detection import CameraPictures, Detection, RuleCount
from service.pictures.archive import unpack
from service.pictures.listing import Picture, pictures_in_folder, pictures_in_session

DETECTING = 0.85
"""Share of the progress that goes to detection: the rest takes seconds."""

_WORTH_PROCESSES = 8
"""Fewer pictures are found in less time than processes take to start."""


def see(
    plan: TargetPlan,
    task: Task[RequestT, ResultT],
    running: Running,
    look: Callable[[DetectedPictures], None] | None = None,
    leave_out: LeaveOut = LeaveOut.NONE,
) -> DetectedPictures:
    """The targets of ``plan`` in the pictures that a task was given.

    ``leave_out``: without the cameras whose pictures cannot be used in such a way.

    ``look`` is called while the pictures are still there: those of an archive are unpacked for
    as long as this takes.

    Those are an archive (input ``pictures``), or the session or folder of pictures that its run
    names. Writes ``detections.json`` into the task's folder.
    """
    running.report(Progress("reading the pictures", 0.0))
    require_opencv()
    with tempfile.TemporaryDirectory(prefix="pictures-", dir=task.folder.parent) as temporary:
        pictures = taken_pictures(task, Path(temporary))

        with _executor(task.run.workers, len(pictures)) as executor:
            seen = detect_pictures(
                [TakenPicture(p.camera, p.frame, p.path) for p in pictures],
                plan,
                progress=within(running.report, 0.0, DETECTING),
                cancel=running.cancel,
                executor=executor,
                leave_out=leave_out,
            )
        if look is not None:
            look(seen)
    document = json.dumps(_document(seen), allow_nan=False) + "\n"
    (task.folder / "detections.json").write_text(document, encoding="utf-8")
    return seen


def taken_pictures(task: Task[RequestT, ResultT], temporary: Path) -> Sequence[Picture]:
    """The pictures that a task was given; an archive is unpacked into ``temporary``."""
    if "pictures" in task.inputs:
        unpack(task.inputs["pictures"], temporary)
        return pictures_in_folder(temporary)
    if task.run.session is not None:
        return pictures_in_session(Path(task.run.session), task.run.captures)
    return pictures_in_folder(Path(task.run.pictures or ""))


@contextmanager
def _executor(workers: int, pictures: int) -> Iterator[Executor | None]:
    if workers < 2 or pictures < _WORTH_PROCESSES:
        yield None
        return
    with ProcessPoolExecutor(min(workers, pictures), get_context("spawn")) as executor:
        yield executor


def detection_of(seen: DetectedPictures) -> Detection:
    """What was found, in short."""
    rejected = Counter(r.rule.value for found in seen.detections for r in found.rejections)
    pictures = Counter(picture.camera for picture in seen.pictures)
    return Detection(
        pictures=len(seen.pictures),
        frames=len(seen.observations.frames),
        targets=sum(len(found) for found in seen.detections),
        cameras=[
            CameraPictures(name=name, pictures=pictures[name], targets=count)
            for name, count in seen.counts().items()
        ],
        rejected=[RuleCount(rule=rule, count=count) for rule, count in rejected.most_common()],
    )


def _document(seen: DetectedPictures) -> dict[str, object]:
    return {
        "schema": "rigwright.detections/1",
        "pictures": [
            {
                "camera": picture.camera,
                "frame": picture.frame,
                "image_size_px": list(found.image_size_px),
                "targets": [
                    {"id": name, "pixel": pixel, "sigma_px": sigma}
                    for name, pixel, sigma in zip(
                        found.ids, found.pixel.tolist(), found.sigma_px.tolist(), strict=True
                    )
                ],
                "rejections": [_rejection(r) for r in found.rejections],
            }
            for picture, found in zip(seen.pictures, seen.detections, strict=True)
        ],
    }


def _rejection(rejection: Rejection) -> dict[str, object]:
    return {**plain(rejection), "rule": rejection.rule.value}
