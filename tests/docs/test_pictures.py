"""The pictures of the README: made by a command, and told when they are stale."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from service.reference import pictures
from service.reference.pictures import (
    PHOTOGRAPH_PX,
    RECORD,
    SHOTS,
    Shot,
    headings_of,
    inputs_digest,
    steps_to,
)
from service.reference.walk import Step, steps_of

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "pictures"
STEPS = steps_of(ROOT / "README.md")
STALE = "stale, run: python -m service.reference.pictures docs/pictures"


@pytest.mark.parametrize("shot", SHOTS, ids=lambda shot: shot.name)
def test_pictures_are_of_what_the_readme_makes_today(shot: Shot) -> None:
    told = json.loads((FOLDER / RECORD).read_text(encoding="utf-8"))[shot.name]
    assert told["inputs"] == inputs_digest(shot, STEPS), f"{shot.name} is {STALE}"
    with Image.open(FOLDER / shot.name) as picture:
        if shot.source.endswith(".html") and not shot.element:
            assert picture.size == shot.size_px
        else:
            assert min(picture.size) > PHOTOGRAPH_PX // 3
        # A page that was not drawn is one colour nearly everywhere.
        assert len(set(picture.convert("L").resize((64, 64)).tobytes())) > 30


@pytest.mark.parametrize("shot", SHOTS, ids=lambda shot: shot.name)
def test_another_command_style_or_size_makes_a_picture_stale(
    shot: Shot, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = inputs_digest(shot, STEPS)
    first, *others = STEPS
    assert inputs_digest(shot, (Step(f"{first.line} --seed 2", 0), *others)) != before
    assert inputs_digest(replace(shot, size_px=(10, 10)), STEPS) != before
    monkeypatch.setattr(pictures, "looks", lambda _: "another style")
    assert inputs_digest(shot, STEPS) != before


def test_what_comes_after_a_picture_leaves_it_alone() -> None:
    rig = SHOTS[0]
    assert inputs_digest(rig, STEPS) == inputs_digest(rig, (*STEPS, Step("rigwright more", 0)))
    assert [step.line for step in steps_to(rig, STEPS)] == ["rigwright demo --out demo"]
    check = next(s for s in SHOTS if s.name == "check.png")
    assert steps_to(check, STEPS)[-1].exit_code == 4


def test_figures_of_a_heading_do_not_count(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        "<h1>The check <b>2026-11-29T10:00:00Z</b> fine</h1><h4>no</h4><h2 id='x'>Cameras</h2>"
        "\n<script>'<h1>code</h1>'</script>"
    )
    assert headings_of(page) == ["The check fine", "Cameras"]


def test_every_picture_of_the_readme_is_made_by_the_command() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert {s.name for s in SHOTS} == {
        name for name in (path.name for path in FOLDER.iterdir()) if f"pictures/{name}" in readme
    }
