"""Training: classifiers from a population, thresholds from persons that they have not seen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from common.errors import InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)
from evaluation.recognition.classifier import train_classifier
from evaluation.recognition.recogniser import (
    LEAST_REGIONS,
    Rates,
    Recogniser,
    pairs_of,
    rates_of,
    threshold_at,
)
from evaluation.recognition.regions import REGIONS, region_places, thinned
from geometry.arrays import Bools, Floats, Ints

LEAST_PERSONS = 12
FALSE_MATCH_RATE = 0.001
REGION_FALSE_MATCH_RATE = 0.01
"""Of one region alone: the vote makes of thirty weak ones one strong."""

_FOLDS = 3
_MOST_HELD_OUT = 800


def train(
    depth_mm: Floats,
    person: Ints,
    *,
    false_match_rate: float = FALSE_MATCH_RATE,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Recogniser:
    """A recogniser from range images (n, h, w), NaN for holes, and the person (n,) of each.

    Every person in turn is left out with a third of all; how alike strangers look to
    classifiers that saw neither sets the thresholds, and gives the rates. Raises
    :class:`InputError` for too few persons or captures, :class:`CancelledError` when told to stop.
    """
    person = np.unique(person, return_inverse=True)[1].astype(np.int64)
    _require_enough(person, false_match_rate)
    faces = np.stack([thinned(image) for image in depth_mm])
    stop = cancel or NeverCancelled()
    ratios, known, same = _held_out(faces, person, progress, stop)
    thresholds = np.array(
        [
            threshold_at(r[~same & k], REGION_FALSE_MATCH_RATE)
            for r, k in zip(ratios, known, strict=True)
        ]
    )
    rates = _voted(ratios, known, same, thresholds, false_match_rate)
    progress(Progress("training", 0.8))
    filled = _filled(faces)
    classifiers = []
    for k, places in enumerate(region_places()):
        go_on(stop)
        progress(Progress("training", 0.8 + 0.2 * k / len(REGIONS)))
        classifiers.append(train_classifier(filled[:, places], person))
    return Recogniser(tuple(classifiers), thresholds, rates)


def _require_enough(person: Ints, rate: float) -> None:
    count = np.bincount(person)
    several = int((count >= 2).sum())
    if several < LEAST_PERSONS:
        raise InputError(
            "population-small",
            f"{several} persons have two captures or more; {LEAST_PERSONS} are the least",
            "give more heads, several of each person",
        )
    if not 0.0 < rate < 0.5:
        raise InputError(
            "false-match-rate", f"the false match rate is {rate:g}", "give one between 0 and 0.5"
        )


def _filled(faces_mm: Floats) -> Floats:
    """Holes take the mean of the other faces there: they then say nothing about the person."""
    there = np.isfinite(faces_mm)
    count = there.sum(axis=0)
    mean = np.where(there, faces_mm, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(there, faces_mm, mean)


def _folds(person: Ints) -> Iterator[Bools]:
    """Persons in thirds, always the same."""
    third = np.random.default_rng(0).permutation(person.max() + 1) % _FOLDS
    for k in range(_FOLDS):
        yield third[person] == k


def _held_out(
    faces: Floats, person: Ints, progress: ProgressCallback, cancel: CancelToken
) -> tuple[Floats, Bools, Bools]:
    """Ratios (r, m) of all pairs of held-out faces, whether known (r, m), whether one person."""
    ratios, known, same = [], [], []
    for number, out in enumerate(_folds(person)):
        rest, rest_person = _filled(faces[~out]), person[~out]
        tried = np.flatnonzero(out)[:_MOST_HELD_OUT]
        one, two = pairs_of(person[tried])
        pick = one | two
        part, part_known = [], []
        for k, places in enumerate(region_places()):
            go_on(cancel)
            done = (number + k / len(REGIONS)) / _FOLDS
            progress(Progress("trying on persons left out", 0.8 * done))
            classifier = train_classifier(rest[:, places], rest_person)
            found = classifier.features(faces[tried][:, places])
            ones = np.ones(len(tried), dtype=np.int64)
            part.append(classifier.ratio(found.values, ones, found.values)[pick])
            part_known.append((found.known[:, None] & found.known[None])[pick])
        ratios.append(np.stack(part))
        known.append(np.stack(part_known))
        same.append(one[pick])
    return (
        np.concatenate(ratios, axis=1),
        np.concatenate(known, axis=1),
        np.concatenate(same),
    )


def _voted(ratios: Floats, known: Bools, same: Bools, thresholds: Floats, rate: float) -> Rates:
    votes = ((ratios > thresholds[:, None]) & known).sum(axis=0)
    voters = known.sum(axis=0)
    enough = voters >= LEAST_REGIONS
    if not (enough & same).any() or not (enough & ~same).any():
        raise InputError(
            "population-holes",
            "too little of the faces was measured to compare any two",
            "give whole faces",
        )
    share = votes / np.maximum(voters, 1)
    return rates_of(share[enough & same], share[enough & ~same], rate)
