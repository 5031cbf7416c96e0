"""The page on targets says what the program does."""

from __future__ import annotations

import re
from pathlib import Path

from calibration.detection.gates import Rule
from calibration.targets.files import targets_from

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "targets.md").read_text("utf-8")


def test_the_page_lists_the_rules_as_they_are() -> None:
    listed = dict(re.findall(r"^\| `([a-z-]+)` \| (.+) \|$", PAGE, re.MULTILINE))
    assert listed == {rule.value: rule.meaning for rule in Rule}


def test_the_example_can_be_read() -> None:
    example, boards, back = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    plan = targets_from(example)
    assert [c.name for c in plan.carriers] == ["plate", "stand", "bar"]
    assert plan.distances[0].length_mm == 200.03
    assert [c.name for c in targets_from(boards).carriers] == ["chess", "kalibr", "dots"]
    head = 'schema = "rigwright.targets/1"\nname = "two sides"\n'
    assert targets_from(head + back).carriers[0].ids[-1] == "plate-011-back"
