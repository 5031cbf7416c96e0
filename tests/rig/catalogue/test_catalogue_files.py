"""A user's files, and how the catalogue is listed and searched."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError, NotFoundError
from rig.catalogue import Catalogue, catalogue_entry, catalogue_rows, load_catalogue
from rig.catalogue.loader import _parse

HEAD = 'schema = "rigwright.catalogue/1"\n'
NEW = """
[lens.my-lens]
name = "My lens 25 mm"
maker = "Somebody"
kind = "machine-vision"
mount = "C"
focal_length_mm = 25.3
[[lens.my-lens.source]]
title = "calibration of 3 May"
kind = "measured"
figures = ["focal_length_mm"]
"""


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


def written(tmp_path: Path, text: str, name: str = "mine.toml") -> Path:
    path = tmp_path / name
    path.write_text(HEAD + text, encoding="utf-8")
    return path


def test_a_file_adds_a_part_with_its_sources(tmp_path: Path) -> None:
    lens = load_catalogue([written(tmp_path, NEW)]).lens("my lens 25 MM")
    assert lens.focal_length_mm == 25.3
    assert (lens.sources["focal_length_mm"].title, lens.sources["focal_length_mm"].kind) == (
        "calibration of 3 May",
        "measured",
    )
    assert (lens.sources["mount"].title, lens.sources["mount"].kind) == ("mine.toml", "user")


def test_a_file_changes_the_figures_it_gives_and_keeps_the_others(tmp_path: Path) -> None:
    text = "[camera.canon-eos-250d]\nmass_g = 401.0\ntripod_thread = '3/8-16'\n"
    before = load_catalogue().camera("canon-eos-250d")
    after = load_catalogue([written(tmp_path, text)]).camera("canon-eos-250d")
    assert (before.mass_g, after.mass_g) == (453.0, 401.0)
    assert before.body_size_mm == after.body_size_mm
    assert after.sources["mass_g"].kind == "user"
    assert after.sources["body_size_mm"] == before.sources["body_size_mm"]
    assert load_catalogue().camera("canon-eos-250d").mass_g == 453.0


def test_later_files_go_before_earlier_ones(tmp_path: Path) -> None:
    one = written(tmp_path, "[head.manfrotto-410]\nload_kg = 1.0\n", "one.toml")
    two = written(tmp_path, "[head.manfrotto-410]\nload_kg = 2.0\n", "two.toml")
    head = load_catalogue([one, two]).heads["manfrotto-410"]
    assert head.load_kg == 2.0
    assert head.sources["load_kg"].title == "two.toml"


LINES = {
    "[camera.canon-eos-250d]\nmas_g = 1.0": (
        "mine.toml: camera.canon-eos-250d: mas_g is not known; did you mean mass_g?"
    ),
    "[camera.canon-eos-250d]\nmass_g = -1.0": "camera.canon-eos-250d: mass_g is -1.0; it should be",
    "[camra.x]\nname = 'x'": "mine.toml: camra is not known; did you mean camera?",
    "[camera.mine]\nname = 'x'": "mine.toml: camera.mine: maker is missing",
    NEW.replace('mount = "C"', 'mount = "D"'): "lens.my-lens.mount is 'D'; give one of C, CS",
    NEW.replace("my-lens", "canon-eos-250d"): "has the id of a camera",
    NEW.replace("my-lens]", '"my lens"]').replace("my-lens.", '"my lens".'): "is no id",
    "[lens.kowa-lm25hc]\nmin_focus_mm = 100.0": "give min_focus_mm and min_focus_from together",
    "[lens.kowa-lm25hc]\nf_number_min = 30.0": "f_number_min is above f_number_max",
    "[lens.kowa-lm25hc]\nfocal_length_mm = nan": "it should be a finite number",
    "[camera.rpi-camera-3]\nfixed_lens = 'kowa-lm25hc'": "camera.rpi-camera-3.fixed_lens is",
    "lens = 3": "mine.toml: lens is 3",
    "[lens]\nkowa-lm25hc = 3": "mine.toml: lens.kowa-lm25hc is 3",
    "[lens.kowa-lm25hc]\nsource = 3": "lens.kowa-lm25hc: source is 3",
    "[[lens.kowa-lm25hc.source]]\nfigures = 3": "lens.kowa-lm25hc: source[0].title is missing",
    NEW.replace('["focal_length_mm"]', "3"): "lens.my-lens: source[0].figures is 3",
    NEW.replace('["focal_length_mm"]', '["mass_g"]'): "a source names mass_g, which is not given",
}


@pytest.mark.parametrize("text", LINES)
def test_mistakes_are_one_line_that_names_file_entry_and_key(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        load_catalogue([written(tmp_path, text)])
    assert LINES[text] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_catalogue_files(tmp_path: Path) -> None:
    cases = {
        "missing.toml": None,
        "text.toml": b"hello world",
        "binary.toml": b"\xff\xfe\x00",
        "large.toml": b"# " + b"x" * 5_000_001,
        "empty.toml": b"",
        "other.toml": b'schema = "rigwright.rig/1"',
    }
    for name, content in cases.items():
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            load_catalogue([path])
        assert name in str(caught.value) and "\n" not in str(caught.value)


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=80))
def test_any_text_is_a_catalogue_or_an_input_error(text: str) -> None:
    try:
        _parse(HEAD + text, "any.toml")
    except InputError as error:
        assert "\n" not in str(error)


JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.just([1.0, "a"])
)


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(["mass_g", "mount", "image_size_px", "source", "kind", "zzz"]), JUNK)
def test_any_value_of_a_part_is_read_or_refused(key: str, value: object) -> None:
    from rig.catalogue.loader import _built_in_tables, _catalogue, _laid_over

    tables = {table: dict(entries) for table, entries in _built_in_tables().items()}
    former = tables["camera"]["basler-aca2040-55u"]
    tables["camera"]["basler-aca2040-55u"] = _laid_over(former, {key: value}, "any.toml")
    try:
        _catalogue(tables, {("camera", "basler-aca2040-55u"): "any.toml"})
    except InputError as error:
        assert "\n" not in str(error)


def test_rows_are_json_and_searchable(catalogue: Catalogue) -> None:
    rows = catalogue_rows(catalogue)
    json.dumps(rows, allow_nan=False)
    assert len(rows) == sum(1 for _ in catalogue.parts())
    macros = catalogue_rows(catalogue, "canon MACRO", ["lens"], ["focal_length_mm>=80"])
    assert {row["id"] for row in macros} == {"canon-ef-100-f28l-macro", "canon-rf-85-f2-macro"}
    small = catalogue_rows(catalogue, "", ["camera"], ["mount=c", "shutter=global", "mass_g<=80"])
    assert small
    assert all(row["mass_g"] <= 80.0 and row["shutter"] == "global" for row in small)
    assert catalogue_rows(catalogue, "no such thing") == []
    derived = catalogue_rows(catalogue, "250d", ["camera"])[0]
    assert derived["pixel_pitch_um"] == pytest.approx(22.3 / 6000 * 1000, rel=1e-3)


def test_an_unknown_figure_meets_no_condition(catalogue: Catalogue) -> None:
    ids = {row["id"] for row in catalogue_rows(catalogue, where=["entrance_pupil_mm>=0"])}
    assert ids == {"nikkor-z-50-f18-s"}
    assert catalogue_rows(catalogue, where=["mount<=3"]) == []
    assert catalogue_rows(catalogue, "", ["camera"], ["mass_g=heavy"]) == []


@pytest.mark.parametrize(
    ("tables", "where", "words"),
    [
        (["lenses"], [], "did you mean lens?"),
        ([], ["mas_g<=3"], "did you mean mass_g?"),
        ([], ["mass_g"], "write it like"),
        ([], ["mass_g<=heavy"], "compares with no number"),
    ],
)
def test_wrong_searches(
    catalogue: Catalogue, tables: list[str], where: list[str], words: str
) -> None:
    with pytest.raises(InputError) as caught:
        catalogue_rows(catalogue, "", tables, where)
    assert words in str(caught.value)


def test_an_entry_tells_where_each_figure_comes_from(catalogue: Catalogue) -> None:
    entry = catalogue_entry(catalogue, "Nikkor Z 50mm f/1.8 S")
    json.dumps(entry, allow_nan=False)
    assert entry["table"] == "lens"
    assert entry["figures"]["entrance_pupil_mm"]["kind"] == "derived"
    assert all(figure["source"] for figure in entry["figures"].values())
    camera = catalogue_entry(catalogue, "sony-a7c")
    assert camera["figures"]["pixel_pitch_um"]["kind"] == "derived"
    assert camera["note"] == "The mass includes battery and card."


@pytest.mark.parametrize(
    ("wanted", "near"),
    [
        ("canon-eos-250", "canon-eos-250d"),
        ("Manfroto 410", "manfrotto-410"),
        ("kowa", "kowa-lm"),
        ("qqqq", "rigwright catalogue"),
        ("", "rigwright catalogue"),
    ],
)
def test_a_wrong_name_is_answered_with_the_nearest(
    catalogue: Catalogue, wanted: str, near: str
) -> None:
    with pytest.raises(NotFoundError) as caught:
        catalogue.find(wanted)
    assert near in str(caught.value)
