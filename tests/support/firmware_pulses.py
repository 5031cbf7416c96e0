"""What the tests and the measurements of the firmware's timing share: programmes and floods."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass

from firmware_sim import CYCLES_PER_TICK, FirmwareSim, PinEdge, sealed

ALL = range(1, 17)
PORT_ORDER = {**dict.fromkeys(range(13, 17), 0), **dict.fromkeys(range(1, 7), 1)}
"""Cycles after the first OUT at which an output changes; 2 for outputs 7 to 12."""


@dataclass(frozen=True)
class Burst:
    """One capture as it was programmed: (delay, width) in ticks by output, shots, interval."""

    pulses: Mapping[int, tuple[int, int]]
    shots: int = 1
    interval: int = 0

    @property
    def duration(self) -> int:
        """From a shot's start to its last edge, in ticks."""
        return max(delay + width for delay, width in self.pulses.values())

    @property
    def total(self) -> int:
        """From the first shot's start to the last edge of all, in ticks."""
        return (self.shots - 1) * self.interval + self.duration

    def edges(self) -> list[tuple[int, int, int]]:
        """Every edge: (ticks from the first shot's start, output, level), sorted."""
        edges = []
        for shot in range(self.shots):
            for output, (delay, width) in self.pulses.items():
                start = shot * self.interval + delay
                edges += [(start, output, 1), (start + width, output, 0)]
        return sorted(edges)


def arm(
    box: FirmwareSim, capture: str, burst: Burst, lead: int = 2000, dead_man_ms: int = 0
) -> str:
    """Programme the outputs anew and arm; the reply to ARM. It fires to its end all alone."""
    box.ask("*RST")
    for output, (delay, width) in burst.pulses.items():
        box.ask(f"OUT ch={output} d={delay} w={width}")
    mask = sum(1 << (output - 1) for output in burst.pulses)
    return box.ask(
        f"ARM cap={capture} mask={mask:04X} n={burst.shots} iv={burst.interval} "
        f"lead={lead} ttl=60000 dm={dead_man_ms}"
    )


def fire(box: FirmwareSim, capture: str) -> int:
    """Fire; the tick at which the box says that the first shot begins."""
    reply = box.ask(f"FIRE cap={capture}")
    return int(reply.rpartition("t0=")[2], 16)


def played(box: FirmwareSim, burst: Burst, capture: str = "a", flood: bytes = b"") -> list[PinEdge]:
    """Arm, fire, let it end; the edges that were made. ``flood`` is sent while it fires."""
    assert arm(box, capture, burst).startswith("OK")
    begin = box.cycle
    fire(box, capture)
    box.send(flood)
    box.run_cycles((burst.total + 4000) * CYCLES_PER_TICK)
    box.hush()
    return box.edges(since=begin)


def offsets(burst: Burst, made: list[PinEdge]) -> list[int]:
    """Cycles by which each edge was late on its programme, ports' order taken into account.

    Raises AssertionError when edges are missing, too many or of other outputs.
    """
    wanted = sorted(
        (ticks * CYCLES_PER_TICK + PORT_ORDER.get(output, 2), output, level)
        for ticks, output, level in burst.edges()
    )
    assert sorted((e.output, e.level) for e in made) == sorted(w[1:] for w in wanted)
    due: dict[tuple[int, int], deque[int]] = defaultdict(deque)
    for cycle, output, level in wanted:
        due[output, level].append(cycle)
    start = made[0].cycle - wanted[0][0]
    return [edge.cycle - start - due[edge.output, edge.level].popleft() for edge in made]


def flood_of(seconds: float, noise: bool = False) -> bytes:
    """Bytes for so long a time at the full rate of the line: requests, or noise without end."""
    count = round(seconds * 11520)
    if noise:
        return bytes((7 * i + i // 11) % 256 for i in range(count))
    line = sealed("7 STAT?").encode() + b"\n"
    return (line * (count // len(line) + 1))[:count]
