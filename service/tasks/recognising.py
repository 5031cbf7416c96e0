"""Recognition: a model from a population, persons into a gallery, faces against them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from common.errors import CancelledError, InputError
from common.progress import Progress, within
from evaluation.recognition.faces import read_face
from evaluation.recognition.gallery import Gallery, Trained
from evaluation.recognition.galleryfile import read_gallery, write_gallery
from evaluation.recognition.population import CAPTURES, generated_faces
from evaluation.recognition.recogniser import Rates
from evaluation.recognition.training import train
from geometry.arrays import Floats
from service.jobs.engine import Running, Task
from service.kinds.recognition import (
    EnrolmentRequest,
    EnrolmentResult,
    LeftOut,
    StatedRates,
    TrainingRequest,
    TrainingResult,
    VerificationRequest,
    VerificationResult,
)

GALLERY = "gallery.npz"
_READ = 0.8
"""How far the work has come when all heads are read."""


def training(task: Task[TrainingRequest, TrainingResult], running: Running) -> TrainingResult:
    """Write ``gallery.npz``, a model with nobody enrolled."""
    asked = task.request
    left_out: list[LeftOut] = []
    faces = _read(task, running, left_out) if asked.persons else _generated(asked, running)
    images, persons = [], []
    for person, depth_mm in faces:
        persons.append(person)
        images.append(depth_mm)
    if not images:
        first = left_out[0]
        raise InputError(
            "population-unread", f"no head could be used; {first.name}: {first.why}", "see --help"
        )

    numbers = np.unique(np.array(persons), return_inverse=True)[1].astype(np.int64)
    recogniser = train(
        np.stack(images),
        numbers,
        false_match_rate=asked.false_match_rate,
        progress=within(running.report, _READ, 1.0),
        cancel=running.cancel,
    )
    count = int(numbers.max()) + 1
    trained = Trained(count, len(images), asked.population)
    write_gallery(task.folder / GALLERY, Gallery(recogniser, trained))
    return TrainingResult(
        persons=count, captures=len(images), left_out=left_out, rates=_stated(recogniser.rates)
    )


def _read(
    task: Task[TrainingRequest, TrainingResult], running: Running, left_out: list[LeftOut]
) -> Iterator[tuple[str, Floats]]:
    persons = task.request.persons
    for number, person in enumerate(persons):
        _told(running, number / len(persons), "reading heads")
        path = task.inputs[f"head-{number}"]
        try:
            depth_mm = read_face(path).depth_mm
        except InputError as error:
            left_out.append(LeftOut(name=path.name, why=error.problem))
            continue
        yield person, depth_mm


def _generated(asked: TrainingRequest, running: Running) -> Iterator[tuple[str, Floats]]:
    total = CAPTURES * asked.generated
    for number, (person, face) in enumerate(generated_faces(asked.generated, asked.seed)):
        _told(running, number / total, "making heads")
        yield f"{person:04d}", face.depth_mm


def _told(running: Running, share: float, stage: str) -> None:
    if running.cancel.is_set():
        raise CancelledError
    running.report(Progress(stage, _READ * share))


def enrolment(task: Task[EnrolmentRequest, EnrolmentResult], running: Running) -> EnrolmentResult:
    """Write ``gallery.npz``: the input ``gallery`` with the input ``face``."""
    running.report(Progress("reading", 0.0))
    before = read_gallery(task.inputs["gallery"])
    face = read_face(task.inputs["face"])
    running.report(Progress("enrolling", 0.8))
    name = task.request.name
    new = before.recogniser.template(face.depth_mm)
    gallery = before.enrolled(name, face.depth_mm)
    write_gallery(task.folder / GALLERY, gallery)
    return EnrolmentResult(
        name=name,
        captures=int(gallery.persons[name].captures.max()),
        persons=len(gallery.persons),
        regions=int(new.captures.sum()),
        measured_share=face.frame.measured_share,
    )


def verification(
    task: Task[VerificationRequest, VerificationResult], running: Running
) -> VerificationResult:
    """Whether the input ``face`` is a person of the input ``gallery``."""
    running.report(Progress("reading", 0.0))
    gallery = read_gallery(task.inputs["gallery"])
    gallery.require(task.request.name)
    face = read_face(task.inputs["face"])
    running.report(Progress("comparing", 0.8))
    found = gallery.verify(task.request.name, face.depth_mm)
    return VerificationResult(
        name=found.name,
        same=found.same,
        score=found.score,
        regions=found.regions,
        measured_share=face.frame.measured_share,
        rates=_stated(gallery.recogniser.rates),
    )


def _stated(rates: Rates) -> StatedRates:
    return StatedRates(
        threshold=rates.threshold,
        false_match=rates.false_match,
        false_non_match=rates.false_non_match,
        equal_error=rates.equal_error,
        impostors=rates.impostors,
        genuines=rates.genuines,
    )
