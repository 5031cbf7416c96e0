"""The interlock against trains of pulses: how soon nothing begins any more, and all is low."""

from __future__ import annotations

import pytest
from firmware_pulses import Burst, arm, fire, flood_of
from firmware_sim import CLOCK_HZ, CYCLES_PER_TICK, FirmwareSim

US = CLOCK_HZ // 1_000_000
NO_EDGE_AFTER_US = 24.0
ALL_LOW_WITHIN_US = 32.0
"""Both as `docs/reference/trigger-protocol.md` states them."""

LEAD = 30_000
TRAINS = {
    # Rows of edges 2 us, 10 us and some 30 us apart, and a few by themselves: every way in which
    # the firmware waits for an edge.
    "mixed": {
        **{output: ((output - 1) * 4, 40 + (output - 1) * 4) for output in range(1, 7)},
        **{output: (400 + (output - 7) * 20, 100 + (output - 7) * 20) for output in range(7, 11)},
        11: (900, 66),
        12: (1000, 130),
        15: (1300, 500),
        16: (1400, 90),
        14: (1600, 100),
    },
    "dense": {output: ((output - 1) * 4, 64) for output in range(1, 17)},
    "sparse": {output: ((output - 1) * 130, 65) for output in range(1, 13)},
}
SHOTS, INTERVAL = 2, 12_000


def epoch(box: FirmwareSim) -> int:
    """The cycle of the box's tick 0, from a pulse that it says the instant of."""
    arm(box, "epoch", Burst({13: (0, 100)}), lead=LEAD)
    before = box.cycle
    start = fire(box, "epoch")
    box.run(40.0)
    return box.edges(since=before)[0].cycle - start * CYCLES_PER_TICK


def opened_at(box: FirmwareSim, capture: str, burst: Burst, zero: int, us: float) -> int:
    """Fire, and have the contact open so long after the first shot's start; the cycle of that."""
    assert arm(box, capture, burst, lead=LEAD).startswith("OK")
    cycle = zero + fire(box, capture) * CYCLES_PER_TICK + round(us * US)
    assert cycle > box.cycle
    box.at(cycle, "interlock open")
    box.at(cycle + 2000 * US, "interlock closed")
    return cycle


@pytest.mark.parametrize("flood", [False, True], ids=["quiet", "flood"])
@pytest.mark.parametrize("train", TRAINS)
def test_no_edge_begins_after_the_interlock_opened(
    one_box: FirmwareSim, train: str, flood: bool
) -> None:
    worst(one_box, train, flood, range(-60, 1200, 52))


@pytest.mark.slow
@pytest.mark.parametrize("flood", [False, True], ids=["quiet", "flood"])
@pytest.mark.parametrize("train", TRAINS)
def test_no_edge_begins_whenever_it_opens(one_box: FirmwareSim, train: str, flood: bool) -> None:
    worst(one_box, train, flood, range(-60, 1200, 4))


@pytest.mark.slow
def test_another_processor_stops_as_soon(js_box: FirmwareSim) -> None:
    worst(js_box, "mixed", True, range(-58, 1200, 12))


def worst(box: FirmwareSim, train: str, flood: bool, moments_us: range) -> None:
    burst = Burst(TRAINS[train], SHOTS, INTERVAL)
    stopped, zero = 0, epoch(box)
    for number, us in enumerate(moments_us):
        opened = opened_at(box, f"i{number}", burst, zero, us)
        box.send(flood_of(0.03, noise=True) * flood)
        box.run(25.0)
        box.hush()
        assert "st=FAULT" in box.ask("STAT?")
        late = [(edge.cycle - opened) / US for edge in box.edges(since=opened) if edge.level]
        fell = [(edge.cycle - opened) / US for edge in box.edges(since=opened) if not edge.level]
        assert max(late, default=0.0) <= NO_EDGE_AFTER_US, (us, late)
        assert max(fell, default=0.0) <= ALL_LOW_WITHIN_US, (us, fell)
        stopped += bool(fell)
    assert stopped, "some pulses were cut short"
