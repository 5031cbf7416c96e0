"""When the trigger box's pulses come, in the firmware that is flashed, on two simulators.

    python -m benchmarks.firmware [--out docs/explanation/trigger-timing.md]

Needs avr-gcc; simavr (libsimavr-dev), or node and npm for avr8js. What is not installed is left
out and said so. Every figure is counted in processor cycles from a log of all changes of all 16
outputs; none is taken from what the box says of itself.
"""

from __future__ import annotations

import argparse
import itertools
import random
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
from firmware_pulses import ALL, Burst, flood_of, offsets, played  # noqa: E402
from firmware_sim import CLOCK_HZ, FirmwareSim, Simulator, SimulatorMissing, built  # noqa: E402

SHOTS = 64
BURSTS = 8
INTERVAL_TICKS = 20_000
LINES = {"quiet": b"", "requests": flood_of(0.7), "noise": flood_of(0.7, noise=True)}
LONG = Burst({1: (0, 16_000_000), 12: (60_000_000, 200), 13: (30_000_001, 200_000)})

HEAD = """# When the pulses come

Made by `python -m benchmarks.firmware --out docs/explanation/trigger-timing.md`, with the
firmware of `rig/firmware/` as it is flashed.

**Simulators are not hardware.** simavr and avr8js play the processor cycle by cycle. What they
cannot show: the board's resonator (up to 0.5 % off on an Uno; the host measures it), the
rise of a pin (some 10 ns), opto-couplers (1 to 100 us), cables, and the cameras' own shutter lag,
which is larger than all else. A cycle is 62.5 ns.

*Flood*: the host sends without a pause at the full rate of the line (115200 baud), either requests,
which are answered, or noise. The limits are what this project asks of the firmware.

"""

FOOT = """
Skew is the largest distance of edges that are programmed for one instant, over all 16 outputs:
three ports written by three instructions, one cycle each, in the order PORTB, PORTC, PORTD.

Delay error is the distance of each edge from its programmed time after the first one, the ports'
order taken out, for 16 outputs with random delays and widths. Interval jitter is the spread of the
time from shot to shot.
"""


@dataclass(frozen=True)
class Figures:
    """Worst cases in cycles: skew, delay error, spread of intervals; and what was counted."""

    skew: int
    delay_error: int
    interval_spread: int
    edges: int


def staggered(seed: int) -> Burst:
    """16 outputs with random delays and widths, no two edges nearer than 4 ticks."""
    draw = random.Random(seed)  # noqa: S311 - a repeatable programme, not a secret
    instants = sorted(draw.sample(range(0, INTERVAL_TICKS - 2400, 4), 32))
    draw.shuffle(instants)
    pairs = zip(instants[::2], instants[1::2], strict=True)
    spans = [(min(pair), abs(pair[0] - pair[1])) for pair in pairs]
    # The strobes, whose rest and duty are limited, get the two shortest.
    spans.sort(key=lambda span: span[1])
    pulses = dict(zip([13, 14, *(o for o in ALL if o not in (13, 14))], spans, strict=True))
    return Burst(pulses, shots=SHOTS, interval=INTERVAL_TICKS)


def measure(box: FirmwareSim, flood: bytes) -> Figures:
    """Play bursts of all outputs at once and of all outputs apart."""
    together = Burst(dict.fromkeys(ALL, (1000, 500)), shots=SHOTS, interval=INTERVAL_TICKS)
    skew, error, intervals, edges = 0, 0, [], 0
    for number in range(BURSTS):
        made = played(box, together, capture=f"s{number}", flood=flood)
        groups = [made[start : start + 16] for start in range(0, len(made), 16)]
        skew = max(skew, *(group[-1].cycle - group[0].cycle for group in groups))
        starts = [group[0].cycle for group in groups[::2]]
        intervals += [b - a for a, b in itertools.pairwise(starts)]
        apart = staggered(number)
        late = offsets(apart, played(box, apart, capture=f"d{number}", flood=flood))
        error = max(error, *map(abs, late))
        edges += len(made) + len(late)
    return Figures(skew, error, max(intervals) - min(intervals), edges)


def microseconds(cycles: float) -> str:
    """Cycles as a reader wants them."""
    return f"{cycles:g} cycles ({cycles * 1e6 / CLOCK_HZ:g} us)"


def rows(simulator: Simulator, folder: Path) -> Iterator[str]:
    """The table's lines for one simulator."""
    for line, flood in LINES.items():
        with FirmwareSim(simulator, folder / f"{simulator}-{line}.log") as box:
            box.run(50.0)
            found = measure(box, flood)
        yield (
            f"| {simulator} | {line} | {microseconds(found.skew)} "
            f"| {microseconds(found.delay_error)} "
            f"| {microseconds(found.interval_spread)} | {found.edges} |"
        )


def long_delay(simulator: Simulator, folder: Path) -> str:
    """A sentence on the longest delay."""
    with FirmwareSim(simulator, folder / f"{simulator}-long.log") as box:
        box.run(50.0)
        late = offsets(LONG, played(box, LONG))
    return f"{simulator}: {microseconds(max(map(abs, late)))}"


def report() -> str:
    """The whole document."""
    table = [
        "| simulator | line | skew | delay error | interval jitter | edges |",
        "|---|---|---|---|---|---|",
        "| **limit** | | 2 cycles | 16 cycles (1 us) | quiet 0, flood 32 cycles (2 us) | |",
    ]
    long, absent = [], []
    with tempfile.TemporaryDirectory() as folder:
        for simulator in Simulator:
            try:
                built(simulator)
            except SimulatorMissing as reason:
                absent.append(f"{simulator} was not measured: {reason}.")
                continue
            table += rows(simulator, Path(folder))
            long.append(long_delay(simulator, Path(folder)))
    ending = "Error of the edges after a delay of 30 s, beside pulses of 8 s and 0.1 s: "
    return (
        HEAD + "\n".join([*table, *absent]) + "\n" + FOOT + "\n" + ending + "; ".join(long) + ".\n"
    )


def main() -> None:
    """Print the figures, or write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="write here instead of printing")
    out = parser.parse_args().out
    text = report()
    if out is None:
        print(text)
    else:
        temporary = out.with_suffix(".tmp")
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(out)


if __name__ == "__main__":
    main()
