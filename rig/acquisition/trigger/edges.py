"""From delays and widths to one sorted list of edges, as the box makes it at ARM."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

OUTPUTS = 16
STROBES = (13, 14)


@dataclass(frozen=True)
class OutputEdge:
    """An instant of a shot, and the level of all outputs from then on (bit 0 is output 1)."""

    at: int
    pins: int


def compile_edges(pulses: Mapping[int, tuple[int, int]], mask: int) -> tuple[OutputEdge, ...]:
    """The edges of one shot, sorted; simultaneous ones are one.

    ``pulses`` by output: delay and width in ticks. Width 0, or a bit of ``mask`` that is 0,
    means no pulse.
    """
    changes: dict[int, int] = {}
    for output, (delay, width) in pulses.items():
        bit = 1 << (output - 1)
        if width and mask & bit:
            changes[delay] = changes.get(delay, 0) ^ bit
            changes[delay + width] = changes.get(delay + width, 0) ^ bit
    pins = 0
    edges = []
    for at in sorted(changes):
        pins ^= changes[at]
        edges.append(OutputEdge(at, pins))
    return tuple(edges)


def nearest(edges: tuple[OutputEdge, ...]) -> int:
    """The smallest distance of two edges, in ticks; for a list of two or more."""
    return min(b.at - a.at for a, b in itertools.pairwise(edges))
