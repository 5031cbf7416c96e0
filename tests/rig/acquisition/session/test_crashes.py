"""kill -9 at random moments of captures."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.crashes import run


@pytest.mark.parametrize(("times", "seed"), [(30, 1), pytest.param(200, 2, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_killed_at_random_nothing_committed_is_lost(tmp_path: Path, times: int, seed: int) -> None:
    tally = run(times, seed, tmp_path)
    assert not tally.wrong
    assert tally.kills == times and tally.committed > 0
    # The kills that matter happened: while a capture was armed, and while it was being committed.
    assert tally.outcomes["set aside"] > 0 and tally.outcomes["rolled forward"] > 0
