"""Training: rates are those of persons that were left out."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from recognition_faces import fields, small_gallery

from common.errors import CancelledError, InputError
from evaluation.recognition.recogniser import equal_error, rates_of
from evaluation.recognition.training import train


def test_persons_that_differ_are_told_and_strangers_refused() -> None:
    recogniser = small_gallery().recogniser
    assert recogniser.rates.equal_error < 0.02
    # Other persons than those of the training, the same kind of shapes.
    images, _ = fields(15, 3, 0.1, seed=1)
    templates = [recogniser.template(i) for i in images]
    scores = recogniser.scores(templates[::3], templates[1::3])
    assert np.diag(scores).min() > recogniser.rates.threshold
    assert (scores[~np.eye(15, dtype=bool)] > recogniser.rates.threshold).mean() < 0.05


def test_persons_who_do_not_differ_cannot_be_told() -> None:
    images, _ = fields(45, 1, 0.1)
    recogniser = train(images, np.repeat(np.arange(15), 3), false_match_rate=0.05)
    # 45 pairs of one person: a rate of 0.5 has a sigma of 0.075.
    assert abs(recogniser.rates.equal_error - 0.5) < 0.25
    assert recogniser.rates.false_non_match > 0.6


def test_too_few_persons_are_refused() -> None:
    images, person = fields(11, 2, 0.1)
    with pytest.raises(InputError, match="11 persons have two captures or more; 12 are the least"):
        train(images, person)


def test_it_stops_when_told_to() -> None:
    images, person = fields(12, 2, 0.1)
    stop = threading.Event()
    stop.set()
    with pytest.raises(CancelledError):
        train(images, person, cancel=stop)


def test_rates_count_what_is_above_the_threshold() -> None:
    impostor = np.arange(1000) / 1000.0
    rates = rates_of(np.array([0.4, 0.95, 0.995, 0.9999]), impostor, 0.01)
    assert rates.false_match <= 0.01
    assert rates.threshold == pytest.approx(0.989)
    assert rates.false_non_match == 0.5
    assert (rates.impostors, rates.genuines) == (1000, 4)


def test_the_equal_error_rate_is_where_both_curves_cross() -> None:
    # Shifted by half of their width: a quarter of each is on the wrong side of the middle.
    even = np.linspace(0.0, 1.0, 4001)
    assert equal_error(even + 0.5, even) == pytest.approx(0.25, abs=1e-3)
    assert equal_error(even + 2.0, even) == 0.0
    assert equal_error(even, even) == pytest.approx(0.5, abs=1e-3)
