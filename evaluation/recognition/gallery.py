"""A gallery: a recogniser, and the persons that are enrolled with it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from common.errors import InputError, NotFoundError
from evaluation.recognition.recogniser import Recogniser, Template, same_person
from geometry.arrays import Floats

_NAME = re.compile(r"^\w[\w .\-]{0,79}$")
MOST_PERSONS = 10_000


@dataclass(frozen=True)
class Trained:
    """What a recogniser was trained on: ``persons``, ``captures``, and where they are from."""

    persons: int
    captures: int
    population: str


@dataclass(frozen=True)
class Verification:
    """A face against a person: ``score`` is the share of regions that say it is the person.

    ``regions`` had a vote; ``same`` whether the score is above the threshold of the recogniser.
    """

    name: str
    score: float
    regions: int
    same: bool


@dataclass(frozen=True, eq=False)
class Gallery:
    """Templates by name. Raises :class:`InputError` for names that are none, or too many."""

    recogniser: Recogniser
    trained: Trained
    persons: Mapping[str, Template] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.persons:
            if not _NAME.match(name):
                raise InputError(
                    "person-name",
                    f"{name!r} is no name for a person",
                    "use letters, digits, spaces, dots and hyphens, 80 at most",
                )
        if len(self.persons) > MOST_PERSONS:
            problem = f"a gallery of {len(self.persons):,} persons; {MOST_PERSONS:,} are the most"
            raise InputError("gallery-large", problem, "begin another gallery")
        object.__setattr__(self, "persons", MappingProxyType(dict(self.persons)))

    def enrolled(self, name: str, depth_mm: Floats) -> Gallery:
        """With one more capture, a range image (h, w), of the person."""
        new = self.recogniser.template(depth_mm)
        before = self.persons.get(name)
        if before is not None:
            new = self.recogniser.added(before, new)
        return replace(self, persons={**self.persons, name: new})

    def verify(self, name: str, depth_mm: Floats) -> Verification:
        """Whether a range image (h, w) is of the person.

        Raises :class:`NotFoundError` for somebody who is not enrolled, :class:`InputError` where
        too few regions of both were measured.
        """
        self.require(name)
        enrolled, probe = self.persons[name], self.recogniser.template(depth_mm)
        score = float(self.recogniser.scores([enrolled], [probe])[0, 0])
        regions = int(((enrolled.captures > 0) & (probe.captures > 0)).sum())
        if score != score:
            raise InputError(
                "face-incomplete",
                f"only {regions} regions were measured both now and at enrolment",
                "capture the face again, with light on all of it",
            )
        return Verification(name, score, regions, same_person(score, self.recogniser.rates))

    def require(self, name: str) -> None:
        """Raise :class:`NotFoundError` for somebody who is not enrolled."""
        if name not in self.persons:
            problem = f"{name} is not in the gallery, which has {self._few()}"
            raise NotFoundError("person", problem, "enrol first, or check the name")

    def _few(self) -> str:
        names = sorted(self.persons)
        more = ", ..." if len(names) > 5 else ""
        return ", ".join(names[:5]) + more if names else "nobody"
