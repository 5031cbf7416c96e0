"""A burst whose host falls silent at any moment: the last edge against the last sign of life."""

from __future__ import annotations

import random

import pytest
from firmware_pulses import Burst, arm, fire
from firmware_sim import CYCLES_PER_MS, FirmwareSim, sealed

DEAD_MAN_MS = 500
LATE_BY_MS = 100.0
BURST = Burst({1: (0, 20_000), 13: (5000, 300)}, shots=64, interval=60_000)


def silenced(box: FirmwareSim, moments: int, seed: int) -> list[float]:
    """Milliseconds from the last sign of life to the last edge, for hosts lost at random.

    Some are lost within a line; some come back when all is over, as a frozen one does.
    """
    draw = random.Random(seed)  # noqa: S311 - repeatable moments, not secrets
    found = []
    for number in range(moments):
        assert arm(box, f"d{number}", BURST, dead_man_ms=DEAD_MAN_MS).startswith("OK")
        fire(box, f"d{number}")
        for _ in range(draw.randrange(3)):
            box.run(draw.uniform(0.0, 300.0))
            box.ask("STAT?")
        last = max(cycle for cycle, byte in box.received() if byte == ord("\n"))
        box.run(draw.uniform(0.0, 100.0))
        # Cut within a line, with the checksum still to come: no sign of life.
        box.send(sealed("7 STAT?").encode()[: draw.randrange(12)])
        box.run(DEAD_MAN_MS + LATE_BY_MS)
        after = box.cycle
        box.run(draw.uniform(0.0, 200.0))
        box.hush()
        assert box.ask(f"RES? cap=d{number}").endswith("why=silence")
        assert not box.edges(since=after), "nothing begins again when the host is back"
        found.append((box.edges()[-1].cycle - last) / CYCLES_PER_MS)
    return found


def test_no_edge_after_the_dead_man_s_time(box: FirmwareSim) -> None:
    assert max(silenced(box, 6, seed=1)) <= DEAD_MAN_MS + LATE_BY_MS


@pytest.mark.slow
def test_no_edge_after_the_dead_man_s_time_at_200_moments(one_box: FirmwareSim) -> None:
    late = max(silenced(one_box, 200, seed=2)) - DEAD_MAN_MS
    assert late <= LATE_BY_MS
