"""Targets found where they are, and each rule refusing what it is there for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import target_scenes as scenes
from held_patterns import placed_carrier

from calibration.detection.finding import find_targets
from calibration.detection.gates import Gates, Rule
from calibration.detection.selftest import check_opencv
from calibration.detection.selftest import opencv as shim
from calibration.targets.kinds import CarrierKind, CharucoPlate, TargetPlan
from calibration.targets.rendering import photographed, render
from common.errors import DeviceError, InputError
from geometry.arrays import Floats, Ints

KINDS: tuple[CarrierKind, ...] = (
    scenes.PLATE,
    scenes.markers(),
    scenes.markers(3, dot=False, corners=True),
    scenes.rings(),
    scenes.rings(bits=14),
)


def plan(*kinds: CarrierKind) -> TargetPlan:
    return TargetPlan("set", kinds)


@pytest.fixture(scope="module")
def plate_shot() -> tuple[np.ndarray, dict[str, Floats]]:
    return scenes.shot(scenes.PLATE, scenes.camera(), scenes.rotation(20.0, 5.0, 8.0), 260.0)


@pytest.mark.parametrize(
    ("kind", "tilt", "blur"),
    [
        (KINDS[0], 55.0, 1.2),
        (KINDS[0], 0.0, 0.5),
        (KINDS[1], 55.0, 1.2),
        (KINDS[2], 20.0, 0.7),
        (KINDS[3], 55.0, 1.2),
        (KINDS[4], 0.0, 0.5),
    ],
    ids=lambda v: getattr(v, "name", str(v)),
)
def test_targets_are_found_to_a_fiftieth_of_a_pixel(
    kind: CarrierKind, tilt: float, blur: float
) -> None:
    view = scenes.camera(k1=-0.2)
    turn = scenes.rotation(tilt, 6.0, 30.0)
    image, truth = scenes.shot(kind, view, turn, 230.0, blur_px=blur)
    found = find_targets(image, plan(kind))
    error = scenes.errors(found, truth)
    assert found.ids == kind.ids
    # The project's limits are 0.02 px rms for centres, 0.025 for corners; six targets leave a
    # mean that is known to rms / sqrt(6), which the limit of 0.005 on the bias needs in addition.
    rms = np.sqrt((error**2).mean())
    assert rms <= 0.02
    assert np.abs(error.mean(axis=0)).max() <= 0.005 + 3.0 * rms / np.sqrt(len(error))
    # Stated sigmas are those of the noise with a floor of 0.01: errors of more than 5 are faults.
    assert np.abs(error / found.sigma_px).max() < 5.0
    assert found.blur_px == pytest.approx(blur, abs=0.15)


def test_sixteen_bits_and_colour_are_seen_alike(
    plate_shot: tuple[np.ndarray, dict[str, Floats]],
) -> None:
    image, _ = plate_shot
    grey = find_targets(image, plan(scenes.PLATE))
    for other in (
        image.astype(np.uint16) * 257,
        np.repeat(image[..., None], 3, axis=2),
        np.concatenate(
            [np.repeat(image[..., None], 3, axis=2), np.full_like(image, 255)[..., None]], 2
        ),
    ):
        found = find_targets(other, plan(scenes.PLATE))
        assert found.ids == grey.ids
        assert found.pixel == pytest.approx(grey.pixel, abs=2e-3)


def test_white_on_black_is_found_like_black_on_white(
    plate_shot: tuple[np.ndarray, dict[str, Floats]],
) -> None:
    image, truth = plate_shot
    kind = dataclasses.replace(scenes.PLATE, inverted=True)
    found = find_targets(255 - image, plan(kind))
    assert found.ids == kind.ids
    assert np.sqrt((scenes.errors(found, truth) ** 2).mean()) < 0.02


def changed(image: np.ndarray, rule: Rule, kind: CarrierKind) -> np.ndarray:
    """The picture with the fault that a rule is there for."""
    if rule is Rule.SATURATION:
        return np.clip(image.astype(int) * 2, 0, 255).astype(np.uint8)
    if rule is Rule.CONTRAST:
        return (120 + image.astype(int) // 20).astype(np.uint8)
    left = int(np.flatnonzero((image > 195).any(axis=0))[0])
    # A corner needs its window in the picture, a marker or ring target its white paper.
    cut = left + (55 if isinstance(kind, CharucoPlate) else 8)
    return np.ascontiguousarray(image[:, cut:])


@pytest.mark.parametrize(
    ("rule", "kind"),
    [
        (Rule.SATURATION, scenes.PLATE),
        (Rule.EDGE, scenes.PLATE),
        (Rule.SATURATION, scenes.rings()),
        (Rule.SATURATION, scenes.markers()),
        (Rule.EDGE, scenes.rings()),
        (Rule.EDGE, scenes.markers()),
    ],
    ids=lambda v: getattr(v, "name", None),
)
def test_each_rule_names_itself(rule: Rule, kind: CarrierKind) -> None:
    image, _ = scenes.shot(kind, scenes.camera(), scenes.rotation(10.0), 250.0, noise=0.5)
    found = find_targets(changed(image, rule, kind), plan(kind), explain=False)
    assert rule in {r.rule for r in found.rejections}
    assert len(found) < len(kind.ids)
    assert all(r.rule.value in str(r) for r in found.rejections)


@pytest.mark.parametrize(
    ("gates", "rule"),
    [
        (Gates(smallest_square_px=900.0), Rule.SIZE),
        (Gates(contrast=250.0), Rule.CONTRAST),
        (Gates(blur_share=0.001), Rule.BLUR),
        (Gates(misfit=0.001), Rule.FIT),
        (Gates(plane_px=0.0, plane_share=0.0), Rule.HOMOGRAPHY),
    ],
    ids=lambda v: v.name if isinstance(v, Rule) else "",
)
def test_gates_can_be_set(
    gates: Gates, rule: Rule, plate_shot: tuple[np.ndarray, dict[str, Floats]]
) -> None:
    found = find_targets(plate_shot[0], plan(scenes.PLATE), gates, explain=False)
    assert {r.rule for r in found.rejections} == {rule}


def test_an_id_seen_twice_is_not_used() -> None:
    kind = scenes.rings(3)
    image, _ = scenes.shot(kind, scenes.camera((360, 150)), scenes.rotation(), 240.0)
    found = find_targets(np.concatenate([image, image]), plan(kind), explain=False)
    assert len(found) == 0
    assert {r.rule for r in found.rejections} == {Rule.UNIQUE_ID}


def test_a_target_out_of_its_place_is_refused() -> None:
    kind = scenes.rings(9)
    image, _ = scenes.shot(kind, scenes.camera(), scenes.rotation(5.0), 240.0)
    swapped = list(kind.places)
    swapped[0] = dataclasses.replace(swapped[0], number=swapped[8].number)
    swapped[8] = dataclasses.replace(swapped[8], number=kind.places[0].number)
    found = find_targets(image, plan(dataclasses.replace(kind, places=tuple(swapped))))
    assert {(r.target, r.rule) for r in found.rejections} == {
        (kind.ids[0], Rule.POSE),
        (kind.ids[8], Rule.POSE),
    }


@pytest.mark.parametrize("number", [10, 11, 12])
def test_a_card_over_a_part_of_a_ring_makes_no_other_target_of_it(number: int) -> None:
    kind = scenes.rings()
    # Without what a card at 100 degrees hides, the codes of the other three are that of 7.
    kind = dataclasses.replace(kind, places=scenes.places((7, 10, 11, 12), 2, 26.0))
    image, truth = scenes.shot(kind, scenes.camera((180, 180)), scenes.rotation(), 240.0)
    rows, columns = np.indices(image.shape)
    for name, within in (("ring12-007", -99.0), (f"ring12-{number:03d}", 9.0)):
        x, y = columns - truth[name][0], rows - truth[name][1]
        along = np.cos(np.radians(100.0)) * x + np.sin(np.radians(100.0)) * y
        card = (np.hypot(x, y) < 32.0) & (along > within)
        # White as the paper, with a faint shadow along its edge.
        image[card] = np.where((along[card] > 9.0) & (along[card] < 12.0), 190, 220)
    found = find_targets(image, plan(kind), explain=False)
    assert set(found.ids) == set(kind.ids) - {"ring12-007", f"ring12-{number:03d}"}
    assert ("ring12-007", Rule.FIT) in {(r.target, r.rule) for r in found.rejections}


@pytest.mark.parametrize(
    ("change", "code", "remedy"),
    [
        ({"legacy": True}, "legacy", "legacy = false"),
        ({"columns": 4, "rows": 5}, "swapped", "exchange columns and rows"),
        ({"columns": 6}, "other-board", "correct columns"),
        ({"inverted": True}, "inverted", "inverted = false"),
    ],
)
def test_a_wrong_board_is_explained(
    change: dict[str, int],
    code: str,
    remedy: str,
    plate_shot: tuple[np.ndarray, dict[str, Floats]],
) -> None:
    kind = dataclasses.replace(scenes.PLATE, **change)
    found = find_targets(plate_shot[0], plan(kind))
    assert len(found) == 0
    assert [f.code for f in found.findings] == [code]
    assert remedy in found.findings[0].remedy


def test_another_dictionary_is_named() -> None:
    kind = CharucoPlate("plate", 5, 4, 20.0, 15.0, "DICT_6X6_50")
    image, _ = scenes.shot(kind, scenes.camera((150, 130)), scenes.rotation(), 420.0)
    (finding,) = find_targets(image, plan(scenes.PLATE)).findings
    assert finding.code == "dictionary"
    assert "DICT_6X6" in finding.problem


@pytest.mark.parametrize("kind", KINDS[1:4], ids=lambda k: k.name)
def test_mirrored_pictures_are_noticed(kind: CarrierKind) -> None:
    image, _ = scenes.shot(kind, scenes.camera(), scenes.rotation(15.0), 220.0)
    found = find_targets(np.ascontiguousarray(image[:, ::-1]), plan(kind))
    assert len(found) == 0
    assert [f.code for f in found.findings] == ["mirrored"]


def test_the_back_of_a_plate_is_a_target_of_its_own() -> None:
    plate = dataclasses.replace(scenes.PLATE, back_mm=3.0)
    carrier = plate.carrier()
    # From behind, turned about the upright axis: the paper of the back is nearer by the thickness.
    turn = scenes.rotation(12.0, 180.0, 4.0)
    view, front = scenes.camera(), scenes.middle_mm(scenes.PLATE)
    way = np.array([0.3, -0.2, 230.0]) - turn @ front
    side = placed_carrier(scenes.PLATE, turn, way + turn @ np.array([0.0, 0.0, 3.0]))
    image = photographed(render(view, side, 0.7, 30.0, 220.0, 150.0), 2.0, 1)
    found = find_targets(image, plan(plate))
    assert found.ids == plate.back_ids
    assert found.findings == ()
    local = carrier.nominal_mm @ turn.T + way
    pixels = view.pixels(local[:, :2] / local[:, 2:])
    truth = dict(zip(carrier.ids, pixels, strict=True))
    assert np.abs(scenes.errors(found, truth)).max() < 0.05
    # The front is still the front, and a plate that is told to have one side only is mirrored.
    shown, _ = scenes.shot(scenes.PLATE, view, scenes.rotation(12.0), 230.0)
    assert find_targets(shown, plan(plate)).ids == plate.front_ids
    # Some markers are read from behind, too, as others: the side that shows more is the one seen.
    both = np.hstack([image, shown[:, :150]])
    assert 0 < len(find_targets(np.ascontiguousarray(shown[:, :150]), plan(plate))) <= 8
    assert find_targets(both, plan(plate)).ids == plate.back_ids
    assert [f.code for f in find_targets(image, plan(scenes.PLATE)).findings] == ["mirrored"]


def test_the_self_test_passes_and_refuses_half_a_pixel() -> None:
    assert np.abs(check_opencv()).max() <= 0.05

    def biased(picture: np.ndarray) -> tuple[Ints, Floats]:
        numbers, places = shim.plain_charuco(picture, (5, 4), 20.0, 15.0, "DICT_4X4_50")
        return numbers, places + 0.497

    with pytest.raises(DeviceError, match=r"off by \(\+0\.4\d+, \+0\.4\d+\) px"):
        check_opencv(biased)


def test_an_empty_picture_gives_nothing_and_says_nothing() -> None:
    found = find_targets(np.full((300, 400), 128, np.uint8), plan(*KINDS[:2], *KINDS[3:]))
    assert (len(found), found.rejections, found.findings) == (0, (), ())


def test_gates_must_be_numbers() -> None:
    with pytest.raises(InputError, match="the gate contrast is nan"):
        Gates(contrast=float("nan"))
