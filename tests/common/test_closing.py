"""What is closed when its block ends."""

from __future__ import annotations

import pytest

from common.closing import Closing


class Door(Closing):
    def __init__(self) -> None:
        self.closed = 0

    def close(self) -> None:
        self.closed += 1


def test_a_block_closes_it_whatever_happens() -> None:
    with Door() as door:
        assert door.closed == 0
    assert door.closed == 1
    with pytest.raises(RuntimeError), door:
        raise RuntimeError
    assert door.closed == 2
