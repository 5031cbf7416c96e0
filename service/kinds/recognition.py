"""Recognition of faces: training, enrolment and verification."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from service.kinds.base import JobKind, Request, Result

PersonName = Annotated[str, Field(pattern=r"^\w[\w .\-]{0,79}$")]


class TrainingRequest(Request):
    """Whom to train on: ``persons`` says whose each input ``head-N`` is, in order.

    Without any, ``generated`` persons of the bundled generator.
    """

    persons: list[str] = Field(default_factory=list)
    generated: Annotated[int, Field(ge=0, le=2_000)] = 0
    seed: Annotated[int, Field(ge=0)] = 0
    false_match_rate: Annotated[float, Field(gt=0.0, lt=0.5)] = 0.001
    population: Annotated[str, Field(max_length=500)] = ""


class StatedRates(Result):
    """How often persons whom the training had not seen were told wrongly."""

    threshold: float
    false_match: float
    false_non_match: float
    equal_error: float
    impostors: int
    genuines: int


class LeftOut(Result):
    """A head that could not be used, and why."""

    name: str
    why: str


class TrainingResult(Result):
    """What the model was trained on, how good it is on persons it had not seen."""

    persons: int
    captures: int
    left_out: list[LeftOut]
    rates: StatedRates


class EnrolmentRequest(Request):
    """Whose face the input ``face`` is."""

    name: PersonName


class EnrolmentResult(Result):
    """How many captures the person has now, how much of this one's face was measured."""

    name: str
    captures: int
    persons: int
    regions: int
    measured_share: float


class VerificationRequest(Request):
    """Whether the input ``face`` is this person's."""

    name: PersonName


class VerificationResult(Result):
    """The share of regions that say so, and the rates of that verdict."""

    name: str
    same: bool
    score: float
    regions: int
    measured_share: float
    rates: StatedRates


TRAINING = JobKind("recognition-training", TrainingRequest, TrainingResult)
ENROLMENT = JobKind("recognition-enrolment", EnrolmentRequest, EnrolmentResult)
VERIFICATION = JobKind("recognition-verification", VerificationRequest, VerificationResult)
