"""Rig files that name a camera and a lens."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from common.errors import InputError
from geometry.optics import depth_of_field_mm
from rig.catalogue import load_catalogue
from rig.specification.rigfile import RigFile, parse_rig, read_rig, rig_from_mapping

REPO = Path(__file__).resolve().parents[3]
EXAMPLE = {"model": "canon-eos-250d", "lens": "canon-ef-50-f18-stm", "f_number": 16}


def rig(camera: dict) -> dict:
    return {"schema": "rigwright.rig/1", "camera": camera}


def test_numbers_follow_from_the_parts() -> None:
    camera = rig_from_mapping(rig(EXAMPLE)).camera
    assert camera.image_size_px == (6000, 4000)
    # Sensor 22.3 mm: the pitch is 3.717 um, the circle of confusion two of them.
    assert camera.pixel_pitch_mm == pytest.approx(0.003717)
    assert camera.circle_of_confusion_mm == pytest.approx(0.007434)
    # 2 atan(22.3 / 100) = 25.1 degrees.
    assert camera.field_of_view_deg[0] == pytest.approx(25.14, abs=0.02)
    # The lens focuses at 350 mm from the sensor. Its entrance pupil is taken half-way along its
    # 39.3 mm, the flange is 44 mm before the sensor: 350 - 44 - 19.65.
    assert camera.min_focus_distance_mm == pytest.approx(286.35)
    assert camera.body.size_mm.tolist() == [122.4, 92.6, 69.8]
    assert (camera.body.lens_diameter_mm, camera.body.lens_length_mm) == (69.2, 39.3)
    # Front of the body half a lens behind the projection centre.
    assert camera.body.front_z_mm == pytest.approx(-19.65)
    near, far = depth_of_field_mm(700.0, 50.0, 16.0, camera.circle_of_confusion_mm)
    assert 670.0 < near < 700.0 < far < 730.0
    assert camera.name == "canon-eos-250d canon-ef-50-f18-stm"


def test_a_known_entrance_pupil_is_the_projection_centre() -> None:
    parts = {"model": "nikon-z7-ii", "lens": "nikkor-z-50-f18-s", "f_number": 11}
    camera = rig_from_mapping(rig(parts)).camera
    # 51.6 mm before the flange, which is 16 mm before the sensor; 400 mm from the sensor.
    assert camera.body.front_z_mm == pytest.approx(-51.6)
    assert camera.min_focus_distance_mm == pytest.approx(400.0 - 16.0 - 51.6)
    thicker = {**parts, "body": {"size_mm": [134.0, 100.5, 89.5]}}
    assert rig_from_mapping(rig(thicker)).camera.body.front_z_mm == pytest.approx(-51.6)


def test_an_adapter_lengthens_the_lens() -> None:
    parts = {"model": "canon-eos-r6-ii", "lens": "canon-ef-50-f18-stm", "f_number": 11}
    camera = rig_from_mapping(rig(parts)).camera
    # 24 mm of adapter and 39.3 mm of lens; the pupil half-way; 20 + 31.65 mm from the sensor.
    assert camera.body.lens_length_mm == pytest.approx(63.3)
    assert camera.min_focus_distance_mm == pytest.approx(350.0 - 20.0 - 31.65)


def test_a_distance_from_the_front_counts_from_the_pupil_too() -> None:
    parts = {"model": "rpi-hq", "lens": "rpi-16-c", "f_number": 8}
    camera = rig_from_mapping(rig(parts)).camera
    # 200 mm before the front of a 50 mm lens on a 5 mm ring: 27.5 mm more from its middle.
    assert camera.min_focus_distance_mm == pytest.approx(227.5)


def test_a_built_in_lens_needs_no_name() -> None:
    camera = rig_from_mapping(rig({"model": "rpi-camera-3"})).camera
    assert (camera.focal_length_mm, camera.f_number) == (4.74, 1.8)
    assert camera.name == "rpi-camera-3 rpi-camera-3-lens"


def test_keys_that_are_given_go_first() -> None:
    own = {
        **EXAMPLE,
        "focal_length_mm": 51.3,
        "circle_of_confusion_um": 12.0,
        "image_size_px": [3000, 2000],
        "name": "my camera",
        "body": {"lens_length_mm": 60.0},
    }
    camera = rig_from_mapping(rig(own)).camera
    assert (camera.focal_length_mm, camera.circle_of_confusion_mm) == (51.3, 0.012)
    assert (camera.image_size_px, camera.name) == ((3000, 2000), "my camera")
    assert camera.body.lens_length_mm == 60.0
    assert camera.body.size_mm.tolist() == [122.4, 92.6, 69.8]


def test_a_smaller_image_needs_a_smaller_circle() -> None:
    parts = {"model": "canon-eos-r5", "lens": "canon-ef-s-60-f28-macro", "f_number": 8}
    with pytest.raises(InputError, match=r"covers 26\.8 mm"):
        rig_from_mapping(rig(parts))
    # 5000 x 3333 pixels of 4.395 um: 26.4 mm.
    cropped = rig_from_mapping(rig({**parts, "image_size_px": [5000, 3333]}))
    assert cropped.camera.image_size_px == (5000, 3333)


def test_binned_pixels_are_no_contradiction() -> None:
    binned = {**EXAMPLE, "image_size_px": [3000, 2000], "pixel_pitch_um": 7.434}
    assert rig_from_mapping(rig(binned)).camera.pixel_pitch_mm == pytest.approx(0.007434)


LINES = {
    "model": ("canon-eos-250", "model 'canon-eos-250' is not in the catalogue; did you mean"),
    "lens": ("nikkor-z-50-f18-s", "is made for the mount Z, canon-eos-250d has EF-S; choose canon"),
    "f_number": (32, "f_number is 32, but canon-ef-50-f18-stm has from 1.8 to 22; give 22"),
    "focal_length_mm": (85, "focal_length_mm is 85, but canon-ef-50-f18-stm has 50; leave it out"),
    "image_size_px": ([9000, 6000], "but the sensor of canon-eos-250d has 22.3 x 14.9 mm"),
    "pixel_pitch_um": (5.0, "make 30.0 x 20.0 mm, but the sensor"),
}


@pytest.mark.parametrize("key", LINES)
def test_contradictions_are_one_line(key: str) -> None:
    value, words = LINES[key]
    with pytest.raises(InputError) as caught:
        rig_from_mapping(rig({**EXAMPLE, key: value}), "my.toml")
    message = str(caught.value)
    assert message.startswith("my.toml: camera; ") and words in message
    assert "\n" not in message


def test_a_misspelt_key_is_still_named() -> None:
    with pytest.raises(InputError, match=r"camera\.lenz is not known.*did you mean lens\?"):
        rig_from_mapping(rig({**EXAMPLE, "lenz": "x"}))


def test_what_the_catalogue_does_not_know_is_asked_for() -> None:
    with pytest.raises(InputError, match=r"camera\.min_focus_mm is missing; add it"):
        rig_from_mapping(rig({"model": "rpi-hq", "lens": "kowa-lm25hc", "f_number": 8}))
    with pytest.raises(InputError, match=r"camera\.f_number is missing; add it"):
        rig_from_mapping(rig({k: v for k, v in EXAMPLE.items() if k != "f_number"}))
    with pytest.raises(InputError, match=r"camera\.image_size_px is missing"):
        rig_from_mapping(rig({"lens": "canon-ef-50-f18-stm", "f_number": 8}))


@pytest.mark.parametrize("value", [3, "", ["a"], {"a": 1}, None])
def test_a_name_that_is_no_name(value: object) -> None:
    with pytest.raises(InputError) as caught:
        rig_from_mapping(rig({**EXAMPLE, "model": value, "lens": value}))
    assert "\n" not in str(caught.value)


def test_a_rig_of_parts_describes_itself_in_numbers() -> None:
    spec = rig_from_mapping(rig(EXAMPLE))
    told = RigFile.from_spec(spec)
    assert told.camera.model is None and told.camera.lens is None
    again = RigFile.model_validate(told.model_dump(by_alias=True, exclude_none=True))
    assert RigFile.from_spec(again.to_spec()) == told
    assert again.to_spec().camera.min_focus_distance_mm == spec.camera.min_focus_distance_mm


def test_what_was_read_can_be_read_again() -> None:
    """The service hands a request's model on as data: the names and the numbers together."""
    file = RigFile.model_validate(rig(EXAMPLE))
    again = rig_from_mapping(file.model_dump(by_alias=True, exclude_none=True))
    assert np.array_equal(again.camera.body.size_mm, file.to_spec().camera.body.size_mm)
    assert again.camera.name == file.to_spec().camera.name


def test_a_users_catalogue_is_used(tmp_path: Path) -> None:
    parts = tmp_path / "parts.toml"
    parts.write_text(
        'schema = "rigwright.catalogue/1"\n[camera.canon-eos-250d]\nbody_size_mm = [10, 20, 30]\n',
        encoding="utf-8",
    )
    path = tmp_path / "rig.toml"
    path.write_text(
        'schema = "rigwright.rig/1"\n[camera]\nmodel = "Canon EOS 250D (Rebel SL3)"\n'
        'lens = "canon-ef-50-f18-stm"\nf_number = 8\n',
        encoding="utf-8",
    )
    assert read_rig(path, load_catalogue([parts])).camera.body.size_mm.tolist() == [10, 20, 30]
    assert read_rig(path).camera.body.size_mm.tolist() == [122.4, 92.6, 69.8]


def test_a_fixed_camera_may_name_parts_too() -> None:
    fixed = {
        "name": "old",
        "position_mm": [0, -900, 0],
        "look_at_mm": [0, 0, 0],
        "camera": {"model": "nikon-d850", "lens": "nikon-af-s-85-f18g", "f_number": 11},
    }
    spec = rig_from_mapping({**rig(EXAMPLE), "fixed": [fixed]})
    assert spec.fixed[0].camera.focal_length_mm == 85.0


def test_the_parts_are_found_again_by_the_name_they_give() -> None:
    catalogue = load_catalogue()
    name = rig_from_mapping(rig(EXAMPLE)).camera.name
    body, lens = catalogue.parts_of(name)
    assert (body.id, lens.id) == ("canon-eos-250d", "canon-ef-50-f18-stm")
    assert catalogue.parts_of("camera") is None
    assert all(len(f"{b} {g}") <= 80 for b in catalogue.cameras for g in catalogue.lenses), (
        "a kind of camera's name has 80 characters"
    )


def test_the_schema_lets_parts_stand_for_numbers() -> None:
    schema = json.loads((REPO / "docs/reference/rig.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(rig(EXAMPLE), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(rig({**EXAMPLE, "lenz": "x"}), schema)


def test_rig_files_without_parts_read_as_before() -> None:
    text = (REPO / "examples/face/rig.toml").read_text(encoding="utf-8")
    assert parse_rig(text).camera.name != "camera" or "name" not in text
