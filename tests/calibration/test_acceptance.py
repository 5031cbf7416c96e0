"""Acceptance in the style of VDI/VDE 2634 part 1: lengths, limits, outcomes, the certificate."""

from __future__ import annotations

from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene

from calibration.acceptance import LengthLimit, Outcome, Volume, accept, certificate_pdf
from calibration.acceptance.certificate import Heading
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.observations import Carrier, TargetSet
from common.errors import InputError
from geometry.arrays import Floats

PLACES_MM = np.array([0.0, 60.0, 120.0, 190.0, 260.0, 330.0])
WAYS = np.array(
    [[1, 0, 0], [0, 0, 1], [0.3, 1, 0.2], [1, 0, 1], [1, 0, -1], [1, 1, 0.5], [-1, 1, 0.5]], float
)
GENEROUS = LengthLimit(60.0, 50.0, 80.0)


def bar_scene(lines: int = 7, scale: float = 1.0, targets: int = 6) -> Scene:
    """A bar with targets that cameras see from any side."""
    nominal = np.c_[PLACES_MM[:targets] - 165.0, np.zeros((targets, 2))]
    bar = Carrier(
        "bar", tuple(f"b{k}" for k in range(targets)), nominal, np.full((targets, 3), 1e-3)
    )
    places = [
        RigidTransform(axes(way), 15.0 * np.sin(np.arange(3) + k))
        for k, way in enumerate(WAYS[:lines])
    ]
    return Scene(
        calibrations.small_scene().cameras,
        TargetSet("bar", (bar,)),
        scale * nominal,
        (tuple(places),),
        widest_deg=180.0,
    )


def axes(way: Floats) -> Floats:
    """A rotation whose first axis is ``way``."""
    first = way / np.linalg.norm(way)
    second = np.cross(first, [0.1, 0.2, 1.0])
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def test_a_good_rig_passes_and_its_errors_are_those_predicted() -> None:
    found = accept(calibrations.small_reference(), bar_scene().observe(0.1, 3), GENEROUS)
    assert found.outcome is Outcome.PASSED
    assert found.lines == 7
    assert len(found.lengths) == 35
    z2 = np.array([(m.error_um / m.sigma_um) ** 2 for m in found.lengths])
    # Lengths share ends and calibration: at least seven independent ones. Chi-square(7) / 7 is
    # between 0.09 and 3.7 in all but one of a thousand cases.
    assert 0.09 < z2.mean() < 3.7
    assert found.sentence.startswith("Passed")
    assert found.missing == ()


def test_scale_is_told_from_the_rest() -> None:
    observations = bar_scene(scale=1.0003).observe(0.1, 4)
    found = accept(calibrations.small_reference(), observations, LengthLimit(10.0, 20.0, 15.0))
    assert found.outcome is Outcome.FAILED
    assert found.scale_ppm == pytest.approx(300.0, abs=50.0)
    assert found.rms_after_scale_um < 0.4 * found.rms_um
    # Of 330 mm, 300 ppm are 99 um.
    assert found.largest_um == pytest.approx(99.0, abs=25.0)
    assert "beyond their limit" in found.sentence


def test_errors_by_hand() -> None:
    observations = bar_scene().observe(1e-6, 5)
    truth = replace(calibrations.small_reference(), cameras=calibrations.small_scene().cameras)
    found = accept(truth, observations, GENEROUS)
    assert found.lengths[0].calibrated_mm == 60.0
    assert found.lengths[4].calibrated_mm == 330.0
    # True cameras, and images without noise: nothing but rounding is left.
    assert found.largest_um < 1e-2
    assert found.lengths[4].limit_um == pytest.approx(60.0 + 50.0 * 0.33)
    assert LengthLimit(60.0, 50.0, 70.0).at(330.0) == 70.0


def test_what_is_missing_makes_it_incomplete() -> None:
    reference = calibrations.small_reference()
    few = accept(reference, bar_scene(lines=4).observe(0.1, 6), GENEROUS)
    assert few.outcome is Outcome.INCOMPLETE
    assert "4 lines have 5 lengths or more, 7 are needed" in few.missing
    short = accept(reference, bar_scene(targets=4).observe(0.1, 6), GENEROUS)
    assert any("longest length" in m for m in short.missing)
    large = accept(reference, bar_scene().observe(0.1, 6), GENEROUS, Volume(400.0, 400.0, 400.0))
    assert large.outcome is Outcome.INCOMPLETE
    scene = bar_scene(lines=6)
    twice = replace(scene, places=((*scene.places[0], scene.places[0][0]),))
    same = accept(reference, twice.observe(0.1, 6), GENEROUS)
    assert any("one place" in m for m in same.missing)


def test_an_uncertain_bar_is_told() -> None:
    scene = bar_scene()
    bar = scene.targets.carriers[0]
    rough = Carrier(bar.name, bar.ids, bar.nominal_mm, np.full((6, 3), 0.02))
    observations = replace(scene.observe(0.1, 7), targets=TargetSet("bar", (rough,)))
    found = accept(calibrations.small_reference(), observations, GENEROUS)
    assert any("own uncertainty" in note for note in found.notes)


def test_a_plate_is_no_bar() -> None:
    scene = bar_scene()
    bar = scene.targets.carriers[0]
    corners = np.array([[x, y, 0.0] for y in (0.0, 40.0) for x in (0.0, 50.0, 100.0)])
    plate = Carrier("plate", bar.ids, corners, np.full((6, 3), 1e-3))
    unknown = Carrier("stand", ("s1", "s2", "s3"), np.zeros((3, 3)), np.full((3, 3), np.inf))
    seen = scene.observe(0.1, 9)
    for carriers in ((plate,), (plate, unknown)):
        with pytest.raises(InputError) as caught:
            accept(
                calibrations.small_reference(),
                replace(seen, targets=TargetSet("plates", carriers)),
                GENEROUS,
            )
        assert caught.value.detail == "acceptance-no-bar"
        assert "'plate'" in caught.value.problem and "\n" not in str(caught.value)


def test_only_the_bar_of_a_target_set_is_measured() -> None:
    scene = bar_scene()
    bar = scene.targets.carriers[0]
    square = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [0.0, 30.0, 0.0]])
    plate = Carrier("plate", ("p1", "p2", "p3"), square, np.full((3, 3), 1e-3))
    seen = replace(scene.observe(0.1, 3), targets=TargetSet("both", (bar, plate)))
    found = accept(calibrations.small_reference(), seen, GENEROUS)
    assert {m.line.split(" in ")[0] for m in found.lengths} == {"bar"}


def test_the_longest_length_that_the_default_volume_needs_fits_a_bar_of_20_cm() -> None:
    assert 2.0 / 3.0 * Volume().diagonal_mm == pytest.approx(200.0)


def test_bad_input_is_one_line() -> None:
    for values in ((-1.0, 0.0, 1.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (float("nan"), 1.0, 1.0)):
        with pytest.raises(InputError, match="limit"):
            LengthLimit(*values)
    with pytest.raises(InputError, match="volume"):
        Volume(0.0)
    observations = bar_scene().observe(0.1, 8)
    with pytest.raises(InputError) as caught:
        accept(
            calibrations.small_reference(),
            observations.subset(np.flatnonzero(observations.camera == 0)),
            GENEROUS,
        )
    assert caught.value.detail == "acceptance-no-lengths"
    with pytest.raises(InputError, match="not in the calibration"):
        accept(
            calibrations.small_reference(),
            replace(observations, cameras=("x", *observations.cameras[1:])),
            GENEROUS,
        )


def test_the_certificate_is_a_pdf_that_says_what_it_is_and_is_the_same_twice() -> None:
    pytest.importorskip("reportlab")
    found = accept(calibrations.small_reference(), bar_scene().observe(0.1, 9), GENEROUS)
    heading = Heading(rig="A & B <1>", made_utc="2026-11-22T10:00:00Z", temperature_degc=21.0)
    first = certificate_pdf(found, heading)
    assert first.startswith(b"%PDF-")
    assert first.rstrip().endswith(b"%%EOF")
    assert first == certificate_pdf(found, heading)
    assert first != certificate_pdf(found)
