"""Boards with bad LEDs, fingers, reflections and rolling shutters: read right, or refused."""

from __future__ import annotations

import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import pytest
from random_boards import BOARD, SOUND, trial

from common.errors import InputError
from rig.acquisition.timingboard.reading import read_board

FAR = 5.0
REFUSALS = {f"input/board-{why}" for why in ("dark", "uneven", "unclear", "saturated")}


def judged(seeds: range) -> Counter[str]:
    """How many sound boards there were and were refused, and how many readings were wrong."""
    found: Counter[str] = Counter()
    for seed in seeds:
        one = trial(seed)
        sound = one.kind in SOUND
        found["sound"] += sound
        try:
            said = read_board(
                one.picture, BOARD, exposure_us=one.exposure_us if seed // 8 % 2 else None
            )
        except InputError as error:
            assert error.code in REFUSALS
            found["refused"] += sound
            found["held back"] += not sound
            continue
        half = BOARD.range_us / 2.0
        off = (said.mid_us - one.mid_us + half) % BOARD.range_us - half
        if abs(off) > FAR * said.mid_sigma_us:
            found["wrong"] += 1
            found[f"wrong {seed} {one.kind}"] += 1
    return found


def test_a_bad_board_is_read_right_or_refused() -> None:
    found = judged(range(16))
    assert not found["wrong"], found
    assert not found["refused"], found
    assert found["held back"] > 6


@pytest.mark.slow
def test_many_boards() -> None:
    """``TESTS_BOARDS=2000`` tries as many as are promised; two processes need ten minutes."""
    found: Counter[str] = Counter()
    many = int(os.environ.get("TESTS_BOARDS", "200"))
    with ProcessPoolExecutor(2) as pool:
        for part in pool.map(judged, [range(k, min(k + 50, many)) for k in range(0, many, 50)]):
            found.update(part)
    assert not found["wrong"], found
    assert found["refused"] <= 0.05 * found["sound"], found
