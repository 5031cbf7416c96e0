"""Boxes and drivers for the tests of the trigger."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from trigger_boxes import AnyBox, any_box, box_kinds, opened

from rig.acquisition.trigger.driver import SerialTriggerBox
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake

KINDS = [
    pytest.param(kind, marks=() if kind == "fake" else pytest.mark.slow) for kind in box_kinds()
]


@pytest.fixture(params=KINDS)
def box_under_test(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[AnyBox]:
    with any_box(request.param, tmp_path) as box:
        yield box


@pytest.fixture
def fake() -> Iterator[FakeTrigger]:
    with start_fake() as served:
        yield served


@pytest.fixture
def driver(fake: FakeTrigger) -> Iterator[SerialTriggerBox]:
    with opened(fake.url) as box:
        yield box
