"""Rig files: what is read, what is refused, and in which words."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError, NotFoundError
from geometry.preparation import prepare_subject
from geometry.reading import read_scan
from rig.specification.examples import example_names, example_rig, example_text
from rig.specification.rigfile import RigFile, parse_rig, read_rig, rig_from_mapping
from rig.specification.strategies import Strategy
from solver.limits import Box, HalfSpace, Limits, Roll, Sphere, ZoneOrigin
from solver.matching import Matching, PairTier


def face() -> dict[str, Any]:
    return tomllib.loads(example_text("face"))


def put(data: dict[str, Any], path: str, value: object) -> dict[str, Any]:
    """A copy of ``data`` with the value at a dotted path."""
    data = copy.deepcopy(data)
    *tables, key = path.split(".")
    inner = data
    for table in tables:
        inner = inner.setdefault(table, {})
    inner[key] = value
    return data


def test_the_face_example_is_the_papers_camera() -> None:
    spec = example_rig("face")
    assert spec.count == 7
    # 2 atan(4000 * 5.77 um / (2 * 50 mm)) = 25.99 degrees.
    assert spec.camera.field_of_view_deg[0] == pytest.approx(26.0, abs=0.05)
    assert spec.camera.body.size_mm.tolist() == [62.0, 45.0, 32.0]
    assert spec.limits.spacing is None, "the table is there, switched off"


def test_where_starts_come_from_is_a_choice_that_is_kept() -> None:
    assert rig_from_mapping(face()).strategy is Strategy.EXCHANGE
    spec = rig_from_mapping(put(face(), "strategy", "k-means"))
    assert spec.strategy is Strategy.K_MEANS
    assert RigFile.from_spec(spec).to_spec().strategy is Strategy.K_MEANS


def test_examples_in_the_folder_are_those_of_the_package(repo: Path) -> None:
    assert example_names() == ("face",)
    text = (repo / "examples/face/rig.toml").read_text(encoding="utf-8")
    assert text == example_text("face")
    with pytest.raises(NotFoundError, match="choose one of face"):
        example_text("wall")


def test_the_wall_example_is_table_2(repo: Path) -> None:
    spec = read_rig(repo / "examples/wall/rig.toml")
    assert spec.camera.sensor_size_mm == pytest.approx((22.3, 14.9))
    assert spec.camera.focal_length_mm == 17.2
    assert len(spec.start) == spec.count == 4
    assert np.allclose(spec.start[1].position_rig_mm, [400.0, -35740.0, 5800.0])
    assert np.allclose(spec.start[1].omega_phi_kappa_deg, [91.0, 0.48, 0.0])
    limits = spec.limits
    assert (limits.base_height.min, limits.base_height.mean_min) == (0.2, 0.6)
    assert limits.bounds is not None and limits.bounds.z_mm == 15_000.0
    assert limits.centring is not None and limits.centring.tolerance_px == 0.0
    assert not limits.depth_of_field
    assert limits.body_clearance_mm is None and limits.sight_line_clearance_mm is None


def test_the_wall_is_read_as_it_stands(repo: Path) -> None:
    spec = read_rig(repo / "examples/wall/rig.toml")
    scan = read_scan(repo / "examples/wall/targets.xyz", spec.scan_options)
    targets = prepare_subject(scan, spec.subject_options).subject.design_points
    assert np.allclose(targets.points_mm[0], [-19_500.0, 1200.0, 12_000.0])
    assert len(targets) == 9 and np.allclose(targets.normals, [0.0, -1.0, 0.0])


def test_scan_and_subject_options_come_back() -> None:
    scan = {"units": "inch", "scale": 2.5, "up": "-y", "front": "+x", "subject": "object"}
    subject = {"region": "all", "design_points": 300, "check_points": 900}
    box = {"low_mm": [-1, -2, -3], "high_mm": [1, 2, 3]}
    spec = rig_from_mapping({**face(), "scan": scan, "subject": {**subject, "box": box}})
    assert spec.scan_options.units == "inch"
    assert spec.subject_options.design_count == 300
    told = RigFile.from_spec(spec)
    assert told.scan.model_dump(exclude_none=True) == scan
    assert told.subject.box is not None and told.subject.box.high_mm == [1.0, 2.0, 3.0]
    ball = {"centre_mm": [0, -100, 0], "radius_mm": 80}
    spec = rig_from_mapping({**face(), "subject": {**subject, "sphere": ball}})
    read = RigFile.from_spec(spec).subject.sphere
    assert read is not None and read.radius_mm == 80.0
    with pytest.raises(InputError, match="give a box or a sphere, not both"):
        rig_from_mapping({**face(), "subject": {"box": box, "sphere": ball}})


@pytest.mark.parametrize("name", ["face", "wall"])
def test_a_spec_describes_itself(repo: Path, name: str) -> None:
    spec = read_rig(repo / f"examples/{name}/rig.toml")
    told = RigFile.from_spec(spec)
    again = RigFile.model_validate(told.model_dump(by_alias=True, exclude_none=True))
    assert RigFile.from_spec(again.to_spec()) == told
    assert again.to_spec().camera.pixel_pitch_mm == spec.camera.pixel_pitch_mm
    for one, other in zip(again.to_spec().start, spec.start, strict=True):
        assert (one.rotation_rig_to_camera == other.rotation_rig_to_camera).all()


def test_absent_tables_keep_the_defaults() -> None:
    data = face()
    del data["limits"]
    limits, default = rig_from_mapping(data).limits, Limits()
    assert (limits.frame, limits.depth_of_field) == (default.frame, default.depth_of_field)
    assert limits.body_clearance_mm == default.body_clearance_mm
    assert limits.coverage == default.coverage and limits.base_height == default.base_height


SWITCHES = {
    "bounds": ({"x_mm": 5.0}, lambda x: x.bounds is None),
    "base_height": ({"min": 0.2}, lambda x: x.base_height.min is None),
    "incidence": (
        {"ray_max_deg": 60.0, "mean_max_deg": 30.0},
        lambda x: x.incidence.mean_max_deg is None,
    ),
    "frame": ({}, lambda x: x.frame is None),
    "centring": ({}, lambda x: x.centring is None),
    "spacing": ({"edge_mm": 200.0}, lambda x: x.spacing is None),
    "symmetry": ({"median_tolerance_mm": 1.0}, lambda x: x.symmetry is None),
    "coverage": ({"tier": [{"views": 2, "share": 0.9}]}, lambda x: x.coverage.tiers == ()),
    "depth_of_field": ({}, lambda x: not x.depth_of_field),
    "gsd": ({"max_mm": 0.2}, lambda x: x.gsd_max_mm is None),
    "stand_off": ({"min_mm": 500.0}, lambda x: x.stand_off.min_mm is None),
    "bodies": ({"clearance_mm": 5.0}, lambda x: x.body_clearance_mm is None),
    "sight_lines": ({"clearance_mm": 5.0}, lambda x: x.sight_line_clearance_mm is None),
    "zones": (
        {"sphere": [{"use": "forbidden", "centre_mm": [0, 0, 0], "radius_mm": 9}]},
        lambda x: x.zones.forbidden == (),
    ),
    "motion": ({"x_mm": 5.0}, lambda x: x.motion is None),
}


def test_rolls_and_matching_are_read_and_written() -> None:
    absent = rig_from_mapping(face()).limits
    assert (absent.roll, absent.matching) == (Limits().roll, Limits().matching)
    assert not absent.matching.required
    matching: dict[str, Any] = {"max_angle_deg": 30.0, "max_incidence_deg": 60.0}
    matching |= {"max_scale_ratio": 1.3, "required": True, "tier": [{"pairs": 2, "share": 0.9}]}
    data = put(put(face(), "limits.roll", "level-or-portrait"), "matching", matching)
    spec = rig_from_mapping(data)
    assert spec.limits.roll is Roll.LEVEL_OR_PORTRAIT
    assert spec.limits.matching == Matching(30.0, 60.0, 1.3, 0.1, True, (PairTier(2, 0.9),))
    again = RigFile.from_spec(spec).to_spec().limits
    assert (again.roll, again.matching) == (spec.limits.roll, spec.limits.matching)
    with pytest.raises(InputError, match="22 pairs, but 7 cameras are 21") as caught:
        rig_from_mapping(put(data, "matching.tier", [{"pairs": 22, "share": 0.9}]))
    assert caught.value.detail == "limits-contradict"
    with pytest.raises(InputError, match=r"limits\.roll"):
        rig_from_mapping(put(face(), "limits.roll", "landscape"))
    with pytest.raises(InputError, match=r"matching\.max_angle_deg"):
        rig_from_mapping(put(face(), "matching", {"max_angle_deg": 0.0}))


def test_every_limit_has_a_switch() -> None:
    from rig.specification.sections.limits import LimitsSection

    assert set(SWITCHES) | {"image_sigma_px", "roll"} == set(LimitsSection.model_fields)


@pytest.mark.parametrize("family", SWITCHES)
def test_a_switch_turns_its_limit_off_and_nothing_else(family: str) -> None:
    values, is_off = SWITCHES[family]
    base = face()
    base["limits"] = {}
    on = rig_from_mapping(put(base, f"limits.{family}", {"enabled": True, **values})).limits
    off = rig_from_mapping(put(base, f"limits.{family}", {"enabled": False, **values})).limits
    assert not is_off(on)
    assert is_off(off)
    if family == "incidence":
        assert off.incidence.ray_max_deg == 60.0


def test_zones_of_all_kinds() -> None:
    zones = {
        "box": [{"use": "forbidden", "low_mm": [-1, -2, -3], "high_mm": [1, 2, 3]}],
        "sphere": [{"use": "allowed", "centre_mm": [0, -700, 0], "radius_mm": 400}],
        "plane": [{"use": "allowed", "normal": [0, -2, 0], "offset_mm": 150}],
    }
    read = rig_from_mapping(put(face(), "limits.zones", zones)).limits.zones
    assert [type(zone) for zone in read.allowed] == [Sphere, HalfSpace]
    assert isinstance(read.forbidden[0], Box)
    assert read.about is None
    about = rig_from_mapping(put(face(), "limits.zones", {**zones, "frame": "head"}))
    assert about.limits.zones.about is ZoneOrigin.HEAD
    assert RigFile.from_spec(about).to_spec().limits.zones.about is ZoneOrigin.HEAD
    plane = read.allowed[1]
    assert isinstance(plane, HalfSpace)
    assert plane.normal.tolist() == [0.0, -1.0, 0.0] and plane.offset_mm == 150.0


def test_fixed_cameras_stand_where_they_are_put() -> None:
    fixed = [
        {"name": "old left", "position_mm": [-200, -700, 0], "look_at_mm": [0, 0, 0]},
        {
            "name": "old right",
            "position_mm": [200, -700, 0],
            "rotation_rig_to_camera": [[0.9615, 0.2747, 0], [0, 0, -1], [-0.2747, 0.9615, 0]],
            "focus_mm": 720,
        },
    ]
    spec = rig_from_mapping(put(face(), "fixed", fixed))
    left, right = spec.fixed
    assert left.fixed and left.focus_distance_mm == pytest.approx(np.hypot(200, 700))
    # The matrix has four digits; each entry is rounded by 5e-5 at most.
    r = right.pose.rotation_rig_to_camera
    assert np.abs(r @ r.T - np.eye(3)).max() < 1e-15
    assert np.abs(r[2] - [-0.2747, 0.9615, 0]).max() < 1e-4


LINES = {
    "limits.base_hieght": (
        {"min": 0.1},
        "limits.base_hieght is not known; did you mean base_height?",
    ),
    "limits.coverage.tier": (
        [{"view": 2, "share": 0.9}],
        "limits.coverage.tier[0].view is not known (1 more to mend after it); did you mean views?",
    ),
    "camera.focal_lenght_mm": (
        50.0,
        "camera.focal_lenght_mm is not known; did you mean focal_length_mm?",
    ),
    "camra": ({}, "camra is not known; did you mean camera?"),
    "zzz": (1, "zzz is not known; the keys here are schema, name, cameras"),
    "camera.f_number": (-1.0, "camera.f_number is -1.0; it should be from 0.5 to 128"),
    "camera.image_size_px": ([4000], "camera.image_size_px is [4000]; "),
    "cameras": (7.5, "cameras is 7.5; it should be a valid integer"),
    "camera.focal_length_mm": (
        float("nan"),
        "camera.focal_length_mm is nan; it should be a finite number",
    ),
    "camera.name": ("<b>", "camera.name is '<b>'"),
    "schema": ("rigwright.rig/9", "schema is 'rigwright.rig/9'; it should be 'rigwright.rig/1'"),
    "limits.symmetry": (
        {"axes": "x"},
        "limits.symmetry; give median_tolerance_mm, balance_tolerance_mm or both",
    ),
    "start": ([{"position_mm": [0, 0, 0]}], "start[0]; give exactly one of omega_phi_kappa_deg"),
    "subject.region": ("nose", "subject.region is 'nose'"),
    "camera.pixel_pitch_um": (5800.0, "100 micrometres; did you mean 5.8 micrometres (5800 nano"),
    "camera.circle_of_confusion_um": (0.0115, "did you mean 11.5 micrometres (0.0115 millimet"),
    "camera.min_focus_mm": (0.35, "did you mean 350 mm (0.35 metres)?"),
    "camera.body": (
        {"size_mm": [0.062, 0.045, 0.032]},
        "camera.body.size_mm[0] is 0.062 (2 more to mend after it); it should be from 1 to 2000 mm",
    ),
    "limits.incidence.ray_max_deg": (1.3, "did you mean 74.48 degrees (1.3 radians)?"),
    "limits.incidence": ({"ray_max_deg": 0.0}, "it should be from 2 to 89 degrees"),
    "limits.stand_off": ({"min_mm": 0.5}, "did you mean 500 mm (0.5 metres)?"),
    "limits.base_height.neighbour_max": (30.0, "did you mean 0.3 (30 per cent)?"),
    "limits.coverage": (
        {"tier": [{"views": 2, "share": 99.9}]},
        "limits.coverage.tier[0].share is 99.9; it should be from 1e-06 to 1; did you mean 0.999",
    ),
    "limits.motion": ({"yaw_deg": 0.087}, "did you mean 4.985 degrees (0.087 radians)?"),
    "limits.gsd": ({"max_mm": 150.0}, "did you mean 0.15 mm (150 micrometres)?"),
    "limits.spacing.edge_mm": (0.2, "did you mean 200 mm (0.2 metres)?"),
    "limits.zones.sphere": (
        [{"use": "allowed", "centre_mm": [0, -1, 0], "radius_mm": 0.4}],
        "did you mean 400 mm (0.4 metres)?",
    ),
    "limits.zones.box": (
        [{"use": "allowed", "low_mm": [-0.3, -2, -0.9], "high_mm": [0.3, -0.1, -0.4]}],
        "a box of 0.6 x 1.9 x 0.5 mm holds nothing; did you give its corners in metres?",
    ),
    "limits.zones.plane": (
        [{"use": "allowed", "normal": [0, -1, 0], "offset_mm": 0.15}],
        "did you mean 150 mm (0.15 metres)?",
    ),
    "fixed": (
        [{"name": "a", "position_mm": [0.2, -0.7, 0], "look_at_mm": [0, 0, 0]}],
        "did you mean [200, -700, 0] (metres)?",
    ),
    "matching": ({"max_angle_deg": 0.7}, "did you mean 40.11 degrees (0.7 radians)?"),
    "subject.sphere": ({"centre_mm": [0, 0, 0], "radius_mm": 0.09}, "did you mean 90 mm (0.09 me"),
    "strategy": ("luck", "strategy is 'luck'; it should be 'exchange'"),
}


@pytest.mark.parametrize("path", LINES)
def test_errors_are_one_line_that_says_what_to_do(path: str) -> None:
    value, expected = LINES[path]
    with pytest.raises(InputError) as caught:
        rig_from_mapping(put(face(), path, value), "my.toml")
    message = str(caught.value)
    assert message.startswith("my.toml: ")
    assert expected in message
    assert "\n" not in message


LENSES = {
    0.05: "did you mean 50 mm (0.05 metres)?",
    8665.5: "did you mean 50 mm (8665.5 pixels)?",
    50_000.0: "did you mean 50 mm (50000 micrometres)?",
    1.0: "did you mean 25.4 mm (1 inches)?",
}


@pytest.mark.parametrize("given", LENSES)
def test_a_focal_length_in_another_unit_is_told_by_the_picture(given: float) -> None:
    with pytest.raises(InputError) as caught:
        rig_from_mapping(put(face(), "camera.focal_length_mm", given))
    # 4000 x 2667 pixels of 5.77 um are 27.7 mm across.
    assert "no lens of that length has a picture of 27.7 mm across" in str(caught.value)
    assert LENSES[given] in str(caught.value)


def test_every_number_of_a_rig_file_has_two_ends() -> None:
    def numbers(schema: object, path: str) -> Iterator[tuple[str, dict[str, Any]]]:
        if isinstance(schema, dict):
            if schema.get("type") in ("number", "integer"):
                yield path, schema
            for key, inner in schema.items():
                yield from numbers(inner, f"{path}/{key}")
        elif isinstance(schema, list):
            for k, inner in enumerate(schema):
                yield from numbers(inner, f"{path}/{k}")

    found = dict(numbers(RigFile.model_json_schema(), ""))
    low, high = ({"minimum", "exclusiveMinimum"}, {"maximum", "exclusiveMaximum"})
    open_ended = {p for p, s in found.items() if not (low & set(s) and high & set(s))}
    # A focal length is held by its picture; the others are a scan's own units, or have none.
    told = {p.split("/properties/")[1].split("/")[0] for p in open_ended}
    assert told == {"focal_length_mm", "distortion", "principal_point_px", *OWN}, open_ended


OWN = (
    "rotation_rig_to_camera",
    "rotation_file_to_rig",
    "normal",
    "nose_tip",
    "left_eye",
    "right_eye",
)


def test_a_missing_key_is_named() -> None:
    data = face()
    del data["camera"]["f_number"]
    with pytest.raises(InputError, match=r"camera\.f_number is missing; add it"):
        rig_from_mapping(data)


CONTRADICTIONS = {
    "base_height": ({"limits.base_height": {"min": 0.4, "max": 0.3}}, ("0.4", "0.3")),
    "base_height_mean": (
        {"limits.base_height": {"min": 0.4, "mean_max": 0.3}},
        ("min", "mean_max"),
    ),
    "base_height_over_2": ({"limits.base_height": {"min": 2.5}}, ("2.5", "2")),
    "stand_off": ({"limits.stand_off": {"min_mm": 900, "max_mm": 800}}, ("900", "800")),
    "focus": ({"limits.stand_off": {"max_mm": 300}}, ("stand_off.max_mm", "min_focus_mm")),
    "own_focus": (
        {"camera.focus_mm": 900, "limits.stand_off": {"max_mm": 700}},
        ("stand_off.max_mm", "camera.focus_mm"),
    ),
    "reach_without_sharpness": (
        {"limits.stand_off": {"max_mm": 345}, "limits.depth_of_field": {"enabled": False}},
        ("stand_off.max_mm", "min_focus_mm"),
    ),
    "gsd": (
        {"limits.gsd": {"max_mm": 0.04}, "limits.stand_off": {"min_mm": 500}},
        ("gsd", "stand_off.min_mm"),
    ),
    "gsd_focus": (
        {"limits.gsd": {"max_mm": 0.03}, "limits.stand_off": {}},
        ("gsd", "min_focus_mm"),
    ),
    "margin": ({"limits.frame": {"margin_px": 1400}}, ("margin_px", "image_size_px")),
    "views": ({"cameras": 2}, ("3 views", "2 cameras")),
    "starts": (
        {"start": [{"position_mm": [0, -700, 0], "look_at_mm": [0, 0, 0]}]},
        ("cameras is 7", "1 [[start]]"),
    ),
    "spacing": (
        {
            "limits.spacing": {"edge_mm": 50},
            "limits.base_height": {"min": 0.2},
            "limits.stand_off": {"min_mm": 500},
        },
        ("50 mm", "100 mm"),
    ),
    "spacing_long": (
        {
            "limits.spacing": {"edge_mm": 500},
            "limits.base_height": {"max": 0.3},
            "limits.stand_off": {"max_mm": 900},
        },
        ("500 mm", "270 mm"),
    ),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_contradictions_name_both_sides(name: str) -> None:
    changes, words = CONTRADICTIONS[name]
    data = face()
    for path, value in changes.items():
        data = put(data, path, value)
    with pytest.raises(InputError) as caught:
        rig_from_mapping(data)
    assert caught.value.detail == "limits-contradict"
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_what_is_merely_tight_is_left_to_the_solver() -> None:
    # At 342 mm the near limit of sharpness is met exactly: 350 / (1 + k), k = 0.02208.
    tight = put(put(face(), "limits.stand_off", {"max_mm": 343}), "limits.gsd", {"max_mm": 0.0396})
    assert rig_from_mapping(tight).limits.stand_off.max_mm == 343


def test_another_number_of_cameras() -> None:
    spec = example_rig("face")
    assert spec.with_count(9).count == 9
    with pytest.raises(InputError, match="the rig has 1 camera"):
        spec.with_count(1)
    assert spec.with_seed(5).subject_options.seed == spec.with_seed(5).seed == 5


def test_files_that_are_no_rig_files(tmp_path: Path) -> None:
    cases = {
        "missing.toml": None,
        "text.toml": b"hello world",
        "binary.toml": b"\xff\xfe\x00glTF",
        "large.toml": b"# " + b"x" * 1_000_001,
        "empty.toml": b"",
    }
    for name, content in cases.items():
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            read_rig(path)
        assert name in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError):
        read_rig(tmp_path)


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=200))
def test_any_text_is_a_rig_or_an_input_error(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_rig(text)
    assert "\n" not in str(caught.value)


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.lists(st.floats(), max_size=4),
    st.dictionaries(st.text(max_size=5), st.integers(), max_size=3),
)
PLACES = [
    "camera",
    "camera.body",
    "camera.body.size_mm",
    "camera.focal_length_mm",
    "limits",
    "limits.coverage.tier",
    "limits.zones",
    "limits.zones.box",
    "limits.gsd",
    "limits.motion",
    "start",
    "fixed",
    "cameras",
    "seed",
    "camera.distortion",
    "camera.principal_point_px",
    "limits.base_height",
    "limits.incidence",
    "scan",
    "subject",
]


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(PLACES), JUNK)
def test_any_value_anywhere_is_a_rig_or_an_input_error(path: str, value: object) -> None:
    try:
        rig_from_mapping(put(face(), path, value))
    except InputError as error:
        assert "\n" not in str(error)
