"""The likelihood ratio against densities written out; faces with holes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from common.errors import InputError
from evaluation.recognition.classifier import RegionClassifier, train_classifier


def made(between: list[float]) -> RegionClassifier:
    size = len(between)
    eye = np.eye(size)
    return RegionClassifier(np.zeros(size), eye, np.ones(size), eye, np.array(between))


@pytest.mark.parametrize("captures", [1, 4])
def test_the_ratio_is_that_of_the_densities(captures: int) -> None:
    classifier, rng = made([9.0, 2.0, 0.5]), np.random.default_rng(captures)
    one, two = 2.0 * rng.normal(size=(2, 3)), 2.0 * rng.normal(size=(4, 3))
    found = classifier.ratio(one, np.full(2, captures), two)
    for i in range(2):
        for j in range(4):
            total = 0.0
            for k, b in enumerate(classifier.between):
                own, mean = b + 1.0, b + 1.0 / captures
                pair = [one[i, k], two[j, k]]
                total += multivariate_normal([0, 0], [[mean, b], [b, own]]).logpdf(pair)
                total -= multivariate_normal([0, 0], [[mean, 0], [0, own]]).logpdf(pair)
            assert found[i, j] == pytest.approx(total, abs=1e-9)


def test_a_face_with_holes_lies_near_the_whole_one() -> None:
    rng = np.random.default_rng(0)
    shapes = rng.normal(size=(8, 200))
    person = np.repeat(np.arange(30), 3)
    weights = np.repeat(3.0 * rng.normal(size=(30, 8)), 3, axis=0) + 0.3 * rng.normal(size=(90, 8))
    faces = weights @ shapes
    classifier = train_classifier(faces, person)
    holes = faces[:4].copy()
    holes[:, rng.random(200) < 0.3] = np.nan
    whole, part = classifier.features(faces[:4]), classifier.features(holes)
    assert part.known.all()
    # Eight shapes in 140 places without noise: only the prior of 0.15 mm to some 40 mm bends them.
    assert np.abs(part.values - whole.values).max() < 0.05
    holes[:, 60:] = np.nan
    assert not classifier.features(holes).known.any()


def test_persons_are_told_from_strangers() -> None:
    rng = np.random.default_rng(3)
    person = np.repeat(np.arange(40), 2)
    faces = np.repeat(rng.normal(size=(40, 50)), 2, axis=0) + 0.2 * rng.normal(size=(80, 50))
    classifier = train_classifier(faces, person)
    values = classifier.features(faces).values
    ratio = classifier.ratio(values[::2], np.ones(40, dtype=np.int64), values[1::2])
    assert np.diag(ratio).min() > np.percentile(ratio[~np.eye(40, dtype=bool)], 99.0)


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="do not fit together"):
        RegionClassifier(np.zeros(3), np.eye(2), np.ones(2), np.eye(2), np.ones(2))
    with pytest.raises(InputError, match="do not fit together"):
        made([1.0, -1.0])
