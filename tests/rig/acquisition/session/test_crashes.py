"""kill -9 at random moments of captures."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.crashes import run


# Two hundred times: python -m benchmarks.crashes --times 200
@pytest.mark.parametrize(("times", "seed"), [(80, 2)])
@pytest.mark.slow
def test_killed_at_random_nothing_committed_is_lost(tmp_path: Path, times: int, seed: int) -> None:
    tally = run(times, seed, tmp_path)
    assert not tally.wrong
    assert tally.kills == times and tally.committed > 0
    # The kills that matter happened: while a capture was armed, and while it was being committed.
    assert tally.outcomes["set aside"] > 0 and tally.outcomes["rolled forward"] > 0
