"""Regions that vote: whether two faces are one person's, and how often that is said wrongly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from evaluation.recognition.classifier import Features, RegionClassifier
from evaluation.recognition.regions import REGIONS, region_places, thinned
from geometry.arrays import Bools, Floats, Ints, frozen

_NEVER = 1e9
LEAST_REGIONS = 15
"""Fewer regions than that decide nothing: half of the face would speak for all of it."""


@dataclass(frozen=True)
class Rates:
    """How often held-out faces of the training were told wrongly at a ``threshold`` of votes.

    ``false_match``: of ``impostors`` comparisons of two persons, how many were called one;
    ``false_non_match``: of ``genuines`` comparisons of one person, how many were called two.
    ``equal_error`` is the rate at the threshold where both are alike.
    """

    threshold: float
    false_match: float
    false_non_match: float
    equal_error: float
    impostors: int
    genuines: int


@dataclass(frozen=True, eq=False)
class Template:
    """What is kept of a person.

    ``values`` (d,): the means in all regions' spaces, one after another. ``captures`` (r,): of
    how many captures each is the mean.
    """

    values: Floats
    captures: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        captures = np.array(self.captures, dtype=np.int64)
        if captures.shape != (len(REGIONS),) or not np.isfinite(self.values).all():
            raise InputError("template", "what is kept of a person is malformed", "enrol it again")
        captures.setflags(write=False)
        object.__setattr__(self, "captures", captures)


@dataclass(frozen=True, eq=False)
class Recogniser:
    """A classifier and a ``threshold`` (r,) of its log likelihood ratio for each region."""

    classifiers: tuple[RegionClassifier, ...]
    thresholds: Floats
    rates: Rates

    def __post_init__(self) -> None:
        object.__setattr__(self, "thresholds", frozen(self.thresholds))
        fits = len(self.classifiers) == len(REGIONS) == len(self.thresholds)
        places = [len(p) for p in region_places()]
        if not fits or [len(c.mean_mm) for c in self.classifiers] != places:
            raise InputError(
                "recogniser", "a model has other regions than this program", "train it again"
            )

    @property
    def splits(self) -> Ints:
        """Where one region's values end and the next begin, (r - 1,)."""
        return np.cumsum([len(c.between) for c in self.classifiers])[:-1]

    def template(self, depth_mm: Floats) -> Template:
        """Of one range image (h, w). Raises :class:`InputError` where too few regions are known."""
        found = region_features(self.classifiers, thinned(depth_mm)[None])
        captures = np.array([int(f.known[0]) for f in found])
        if captures.sum() < LEAST_REGIONS:
            raise InputError(
                "face-incomplete",
                f"only {captures.sum()} of {len(captures)} regions of the face were measured; "
                f"{LEAST_REGIONS} are the least",
                "capture the face again, with light on all of it",
            )
        return Template(np.concatenate([f.values[0] for f in found]), captures)

    def scores(self, enrolled: Sequence[Template], probes: Sequence[Template]) -> Floats:
        """Share of the regions that call each pair one person, (n, m); NaN where too few speak."""
        votes = np.zeros((len(enrolled), len(probes)))
        if not votes.size:
            return votes
        voters = np.zeros(votes.shape)
        parts = self._parts(enrolled), self._parts(probes)
        for k, (classifier, least) in enumerate(
            zip(self.classifiers, self.thresholds, strict=True)
        ):
            (one, n), (other, m) = parts[0][k], parts[1][k]
            both = (n > 0)[:, None] & (m > 0)[None]
            votes += both & (classifier.ratio(one, np.maximum(n, 1), other) > least)
            voters += both
        return np.where(voters >= LEAST_REGIONS, votes / np.maximum(voters, 1.0), np.nan)

    def _parts(self, templates: Sequence[Template]) -> list[tuple[Floats, Ints]]:
        values = np.stack([t.values for t in templates])
        captures = np.stack([t.captures for t in templates])
        split = np.split(values, self.splits, axis=1)
        return [(part, captures[:, k]) for k, part in enumerate(split)]

    def added(self, before: Template, new: Template) -> Template:
        """A person's template with one more capture."""
        sizes = [len(c.between) for c in self.classifiers]
        n, m = np.repeat(before.captures, sizes), np.repeat(new.captures, sizes)
        values = (n * before.values + m * new.values) / np.maximum(n + m, 1)
        return Template(values, before.captures + new.captures)


def region_features(classifiers: Sequence[RegionClassifier], faces_mm: Floats) -> list[Features]:
    """Features of faces (n, p), thinned range images, for each region."""
    return [
        classifier.features(faces_mm[:, places])
        for classifier, places in zip(classifiers, region_places(), strict=True)
    ]


def threshold_at(impostor: Floats, rate: float) -> float:
    """The least threshold above which at most ``rate`` of the impostors' scores lie.

    Without impostors nothing is known, and nobody passes.
    """
    if len(impostor) == 0:
        return _NEVER
    ordered = np.sort(impostor)[::-1]
    return float(ordered[min(int(rate * len(ordered)), len(ordered) - 1)])


def equal_error(genuine: Floats, impostor: Floats) -> float:
    """The error rate where as many impostors are let in as persons are turned away."""
    steps = np.unique(np.concatenate([genuine, impostor]))
    steps = np.append(steps, steps[-1] + 1.0)
    match = 1.0 - np.searchsorted(np.sort(impostor), steps) / len(impostor)
    non_match = np.searchsorted(np.sort(genuine), steps) / len(genuine)
    k = int(np.argmax(match <= non_match))
    if k == 0:
        return float(0.5 * (match[0] + non_match[0]))
    # The two curves cross between two steps.
    before, after = match[k - 1] - non_match[k - 1], match[k] - non_match[k]
    t = before / (before - after)
    return float(match[k - 1] + t * (match[k] - match[k - 1]))


def rates_of(genuine: Floats, impostor: Floats, rate: float) -> Rates:
    """Rates at the lowest share of votes that lets in at most ``rate`` of the impostors.

    A person counts as told when the share is above the threshold.
    """
    threshold = threshold_at(impostor, rate)
    return Rates(
        threshold,
        float((impostor > threshold).mean()),
        float((genuine <= threshold).mean()),
        equal_error(genuine, impostor),
        len(impostor),
        len(genuine),
    )


def same_person(score: float, rates: Rates) -> bool:
    """Whether a share of votes says one person."""
    return bool(score > rates.threshold)


def pairs_of(person: Ints) -> tuple[Bools, Bools]:
    """Which pairs (n, n), each once, are of one person and which of two."""
    upper = np.triu(np.ones((len(person), len(person)), dtype=np.bool_), 1)
    same = person[:, None] == person[None]
    return upper & same, upper & ~same
