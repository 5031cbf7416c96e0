"""Rigs of memory: open, with a session, closed again after the test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from memorybench import BenchMaker


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[BenchMaker]:
    maker = BenchMaker(tmp_path)
    yield maker
    maker.close()
