"""What happened is told first and alone: groups, soft and missing pictures, gross mistakes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene

from calibration.adjustment import Calibration
from calibration.adjustment.rotations import rotation_of
from calibration.check import CheckResult, Kind, Light, check
from calibration.check.condition import condition_of
from calibration.detection.detections import PictureProblem
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats
from geometry.frames import Pose

SCENE = calibrations.check_scene()
BLUR_PX = 0.8


def seen(scene: Scene = SCENE, seed: int = 41) -> Observations:
    return scene.observe(0.1, seed)


def checked(observations: Observations, reference: Calibration | None = None) -> CheckResult:
    return check(reference or calibrations.small_reference(), observations)


def first(result: CheckResult, kind: Kind, subjects: set[str], words: str, light: Light) -> None:
    assert result.kinds == (kind,), result.sentence
    assert set(result.findings[0].subjects) == subjects
    assert words in result.sentence
    assert result.light is light


def with_group(which: tuple[int, ...], shift_mm: Floats, turn_rad: Floats) -> Scene:
    """The scene with some cameras moved as one body."""
    turn, cameras = rotation_of(np.asarray(turn_rad)), list(SCENE.cameras)
    middle = np.mean([cameras[k].pose.position_rig_mm for k in which], axis=0)
    for k in which:
        pose = cameras[k].pose
        place = middle + turn @ (pose.position_rig_mm - middle) + shift_mm
        rotation = pose.rotation_rig_to_camera @ turn.T
        cameras[k] = replace(cameras[k], pose=Pose(place, rotation))
    return SCENE.with_cameras(tuple(cameras))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shift_mm", "turn_rad"),
    [((0.06, 0.06, 0.06), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (2e-4, 0.0, -2e-4))],
)
def test_two_cameras_of_one_rail_are_red_together(
    shift_mm: tuple[float, ...], turn_rad: tuple[float, ...]
) -> None:
    scene = with_group((3, 4), np.array(shift_mm), np.array(turn_rad))
    result = checked(seen(scene))
    first(result, Kind.CAMERA_MOVED, {"cam4", "cam5"}, "cannot tell which", Light.RED)
    assert set(result.findings[0].candidates) == {"cam1", "cam2", "cam3"}
    # Points that the group alone sees shift as it did: by 0.1 mm and more.
    assert result.findings[0].effect_mm > 0.05


def with_blur(observations: Observations, camera: int, blur: Floats | float) -> Observations:
    own = observations.camera == camera
    values = np.full(len(observations.pixel), BLUR_PX)
    values[own] = blur
    return replace(observations, blur_px=values)


def sharp_reference() -> Calibration:
    return replace(calibrations.small_reference(), blur_px=np.full(5, BLUR_PX))


def test_a_camera_out_of_focus_is_not_called_moved() -> None:
    observations = with_blur(seen(), 2, 3.0)
    own = np.flatnonzero(observations.camera == 2)
    pixel = observations.pixel.copy()
    pixel[own] += np.random.default_rng(5).normal(0.5, 0.8, (len(own), 2))
    observations = replace(observations, pixel=pixel)
    result = checked(observations, sharp_reference())
    first(result, Kind.BLURRED, {"cam3"}, "out of focus", Light.RED)
    five = np.r_[np.flatnonzero(observations.camera != 2), own[:5]]
    result = checked(observations.subset(np.sort(five)), sharp_reference())
    first(result, Kind.CANNOT_TELL, {"cam3"}, "too few targets", Light.YELLOW)


@pytest.mark.parametrize("share", [0.1, 0.45])
def test_dirt_on_a_lens_is_one_story(share: float) -> None:
    observations = seen()
    own = np.flatnonzero(observations.camera == 1)
    dirty = own[observations.pixel[own, 0] < np.quantile(observations.pixel[own, 0], share)]
    pixel, blur = observations.pixel.copy(), np.full(len(own), BLUR_PX)
    pixel[dirty] += np.random.default_rng(6).normal(0.3, 1.0, (len(dirty), 2))
    blur[np.isin(own, dirty)] = 3.0
    observations = with_blur(replace(observations, pixel=pixel), 1, blur)
    result = checked(observations, sharp_reference())
    first(result, Kind.BLURRED, {"cam2"}, "clean its lens", Light.RED)


def test_a_camera_without_pictures_is_red() -> None:
    observations = seen()
    rows = np.flatnonzero(observations.camera != 3)
    result = checked(observations.subset(rows))
    first(result, Kind.CAMERA_MISSING, {"cam4"}, "no picture with a target", Light.RED)


def test_a_camera_that_sees_a_quarter_of_its_targets_is_told() -> None:
    observations = seen()
    own = np.flatnonzero(observations.camera == 0)
    rows = np.sort(np.r_[np.flatnonzero(observations.camera != 0), own[::4]])
    result = checked(observations.subset(rows))
    first(result, Kind.TARGETS_LOST, {"cam1"}, "dirt on its lens", Light.YELLOW)


Change = Callable[[Floats, tuple[int, int]], Floats]


def with_pixels(camera: int, change: Change) -> Observations:
    """One camera's pixels changed, without those that leave its image."""
    observations = seen()
    width, height = (int(v) for v in observations.image_size_px[camera])
    pixel, own = observations.pixel.copy(), observations.camera == camera
    pixel[own] = change(pixel[own], (width, height))
    inside = ((pixel >= 0.0) & (pixel <= np.array([width, height]) - 1.0)).all(axis=1)
    return replace(observations, pixel=np.clip(pixel, 0.0, None)).subset(np.flatnonzero(inside))


GROSS: dict[str, tuple[Change, str]] = {
    "turned by 90": (
        lambda p, s: (
            (p - np.array(s) / 2.0) @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + np.array(s) / 2.0
        ),
        "turned by 90 degrees",
    ),
    "turned by 270": (
        lambda p, s: (
            (p - np.array(s) / 2.0) @ np.array([[0.0, -1.0], [1.0, 0.0]]) + np.array(s) / 2.0
        ),
        "turned by 270 degrees",
    ),
    "turned by 180": (lambda p, s: np.array(s) - 1.0 - p, "turned by 180 degrees"),
    "mirrored": (lambda p, s: np.array([s[0] - 1.0, 0.0]) + p * np.array([-1.0, 1.0]), "mirrored"),
    "cropped": (lambda p, _: p - np.array([8.0, 0.0]), "shifted by (-8.0,"),
}


@pytest.mark.parametrize("name", GROSS)
@pytest.mark.parametrize("camera", [0, 2])
def test_pictures_that_are_turned_or_cut_otherwise(name: str, camera: int) -> None:
    change, words = GROSS[name]
    result = checked(with_pixels(camera, change))
    first(result, Kind.LENS_CHANGED, {f"cam{camera + 1}"}, words, Light.RED)


def test_images_of_swapped_sides_are_told_as_turned() -> None:
    observations = seen()
    sizes = observations.image_size_px.copy()
    sizes[1] = sizes[1][::-1]
    pixel, own = observations.pixel.copy(), observations.camera == 1
    pixel[own] = pixel[own][:, ::-1]
    result = checked(replace(observations, image_size_px=sizes, pixel=pixel))
    first(result, Kind.LENS_CHANGED, {"cam2"}, "turned by 90 degrees", Light.RED)


@pytest.mark.parametrize(("step", "words"), [(1, "one frame late"), (-1, "one frame early")])
def test_a_camera_a_frame_late_is_told_as_that(step: int, words: str) -> None:
    places = SCENE.places[1]
    other = {
        (1, f): places[min(max(f - step, 0), len(places) - 1)] for f in range(SCENE.frame_count)
    }
    result = checked(seen(replace(SCENE, seen_otherwise=other)))
    first(result, Kind.UNSYNCHRONISED, {"cam2"}, words, Light.RED)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (3, "opposite order to those of the others: sort"),
        # It sees the plate in so few frames that a frame late would look alike.
        (0, "opposite order to those of the others, or one frame late"),
    ],
)
def test_a_folder_in_the_opposite_order(camera: int, words: str) -> None:
    places = SCENE.places[1]
    other = {(camera, f): places[len(places) - 1 - f] for f in range(SCENE.frame_count)}
    result = checked(seen(replace(SCENE, seen_otherwise=other)))
    first(result, Kind.UNSYNCHRONISED, {f"cam{camera + 1}"}, words, Light.RED)


@pytest.mark.parametrize("order", [(4, 3, 2, 1, 0), (1, 2, 3, 4, 0), (2, 4, 1, 0, 3)])
def test_all_folders_in_another_order(order: tuple[int, ...]) -> None:
    cameras = tuple(
        replace(SCENE.cameras[k], name=own.name)
        for k, own in zip(order, SCENE.cameras, strict=True)
    )
    result = checked(seen(SCENE.with_cameras(cameras)))
    assert set(result.kinds) == {Kind.CAMERAS_SWAPPED}, result.sentence


@pytest.mark.parametrize("share", [1e-3, -1e-3, 2e-4])
def test_all_lenses_changed_alike(share: float) -> None:
    cameras = tuple(
        replace(
            c,
            interior=replace(c.interior, focal_length_px=c.interior.focal_length_px * (1 + share)),
        )
        for c in SCENE.cameras
    )
    result = checked(seen(SCENE.with_cameras(cameras)))
    assert result.kinds == (Kind.LENS_CHANGED,), result.sentence
    assert "focal lengths of all cameras" in result.sentence
    assert result.findings[0].value == pytest.approx(share, rel=0.2)


def without_pairs(observations: Observations, cameras: tuple[int, ...]) -> Observations:
    """Each of some cameras with frames of its own, and without what stands still."""
    frames = list(observations.frames)
    frame = observations.frame.copy()
    for k in cameras:
        own = observations.camera == k
        frame[own] += len(frames)
        frames += [f"{k}-{name}" for name in observations.frames]
    still = [c.fixed for c in observations.targets.carriers]
    there = np.array(still)[observations.targets.carrier_of[observations.target]]
    rows = np.flatnonzero(~(there & np.isin(observations.camera, cameras)))
    return replace(observations, frames=tuple(frames), frame=frame).subset(rows)


def test_a_camera_that_nothing_ties_to_the_others_is_named_and_they_are_checked() -> None:
    moved = calibrations.disturbed(SCENE, 0, np.array([0.3, 0.1, 0.0]))
    result = checked(without_pairs(seen(moved), (1,)))
    # Without the stand it sees few targets, too.
    assert result.kinds == (Kind.CANNOT_TELL, Kind.TARGETS_LOST, Kind.CAMERA_MOVED)
    assert [f.subjects for f in result.findings] == [("cam2",), ("cam2",), ("cam1",)]
    assert "give pictures of one instant one name" in result.sentence


def test_a_bar_that_one_camera_alone_sees_spoils_nothing() -> None:
    """Three targets of the plate in a line are seen as a bar of their own, at other instants."""
    observations = seen()
    plate = observations.targets.carriers[1]
    away = plate.nominal_mm - plate.nominal_mm[0]
    along = np.linalg.norm(np.cross(away, away[1]), axis=1) < 1e-6
    ids = [np.array(plate.ids)[side] for side in (~along, along)]
    parts = [
        replace(
            plate,
            name=name,
            ids=tuple(i.tolist()),
            nominal_mm=plate.nominal_mm[side],
            sigma_mm=plate.sigma_mm[side],
        )
        for name, i, side in zip((plate.name, "bar"), ids, (~along, along), strict=True)
    ]
    first_ones, rest = observations.targets.carriers[:1], observations.targets.carriers[2:]
    targets = replace(observations.targets, carriers=(*first_ones, *parts, *rest))
    index = {name: k for k, name in enumerate(targets.ids)}
    target = np.array([index[observations.targets.ids[t]] for t in observations.target])
    bars = targets.carrier_of[target] == 2
    condition = condition_of(
        calibrations.small_reference(),
        replace(observations, targets=targets, target=target).subset(
            np.flatnonzero(~bars | (observations.camera == 1))
        ),
    )
    assert bars.any()
    assert condition.checkable
    assert (~condition.keep).sum() == (bars & (observations.camera == 1)).sum() > 0


def test_a_check_of_few_targets_alone_is_no_check_of_other_instants() -> None:
    observations = seen()
    one = observations.frame == observations.frame[0]
    rows = [np.flatnonzero(one & (observations.camera == k))[:4] for k in range(5)]
    result = checked(observations.subset(np.concatenate(rows)))
    assert result.kinds == (Kind.CANNOT_TELL,), result.sentence
    assert "too few targets" in result.sentence


def test_cameras_of_which_no_two_see_one_thing_are_refused() -> None:
    observations = without_pairs(seen(), (0, 1, 2, 3, 4))
    with pytest.raises(InputError, match="no two cameras see a carrier at the same time"):
        checked(observations)


@pytest.mark.parametrize(
    ("code", "kind", "words"),
    [
        ("dark", Kind.CAMERA_MISSING, "Camera cam3 shows no target: the picture is too dark; see"),
        ("none", Kind.CAMERA_MISSING, "Camera cam3 shows no target of set 'x' in its 4 pictures;"),
        ("unpaired", Kind.UNSYNCHRONISED, "No picture of cam3 has the name"),
        ("mirrored", Kind.LENS_CHANGED, "The images of camera cam3 are mirrored"),
    ],
)
def test_what_detection_told_of_a_camera_is_told_first(code: str, kind: Kind, words: str) -> None:
    problem = {
        "none": "it shows no target of set 'x' in its 4 pictures",
        "unpaired": "no picture of cam3 has the name of another camera's picture",
    }.get(code, f"the picture is too {code}")
    observations = seen()
    names = tuple(n for n in observations.cameras if n != "cam3")
    rows = np.flatnonzero(observations.camera != 2)
    left = observations.subset(rows)
    camera = np.where(left.camera > 2, left.camera - 1, left.camera)
    sizes = np.delete(left.image_size_px, 2, axis=0)
    left = replace(left, cameras=names, camera=camera, image_size_px=sizes)
    problems = {"cam3": PictureProblem(code, problem, "see its light")}
    result = check(calibrations.small_reference(), left, problems=problems)
    first(result, kind, {"cam3"}, words, Light.RED)
    assert all(c.verdict is Kind.FINE for c in result.cameras if c.name != "cam3")
    strange = {"cam9": problems["cam3"]}
    with pytest.raises(InputError, match="camera 'cam9' is not in the reference"):
        check(calibrations.small_reference(), left, problems=strange)


def test_few_targets_in_mirrored_pictures_are_no_story_of_their_own() -> None:
    observations = with_pixels(2, GROSS["mirrored"][0])
    own = np.flatnonzero(observations.camera == 2)
    rows = np.sort(np.r_[np.flatnonzero(observations.camera != 2), own[::4]])
    result = checked(observations.subset(rows))
    first(result, Kind.LENS_CHANGED, {"cam3"}, "mirrored", Light.RED)


def test_ids_that_are_read_in_a_mirror_are_no_story_of_their_own() -> None:
    """All pictures are mirrored, and two targets are taken for each other as the codes are."""
    observations = seen()
    width = int(observations.image_size_px[0][0])
    pixel = observations.pixel * [-1.0, 1.0] + [width - 1.0, 0.0]
    plate = observations.targets.carrier_of == 1
    one, two = np.flatnonzero(plate)[:2]
    target = observations.target.copy()
    target[observations.target == one], target[observations.target == two] = two, one
    result = checked(replace(observations, pixel=pixel, target=target))
    names = {c.name for c in SCENE.cameras}
    first(result, Kind.LENS_CHANGED, names, "all cameras are mirrored", Light.RED)
