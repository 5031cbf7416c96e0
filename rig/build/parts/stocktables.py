"""From which bars to saw, and which bores to tap, as CSV and JSON."""

from __future__ import annotations

from collections.abc import Sequence

from rig.build.parts.screws import Tap
from rig.build.parts.stock import Bar
from rig.build.parts.tables import LISTED, as_csv, as_json

BAR_COLUMNS = ("bar", "part", "length_mm", "pieces", "rest_mm")
TAP_COLUMNS = ("member", "end", "bores", "thread", "depth_mm")


def stock_csv(bars: Sequence[Bar]) -> str:
    """One line per bar: what to saw from it, in this order, and what is left."""
    rows = (
        (
            number,
            bar.part,
            f"{bar.length_mm:.0f}",
            LISTED.join(f"{name} {length:.1f}" for name, length in bar.pieces),
            f"{bar.rest_mm:.1f}",
        )
        for number, bar in enumerate(bars, 1)
    )
    return as_csv(BAR_COLUMNS, rows)


def stock_json(bars: Sequence[Bar]) -> str:
    """The same as JSON."""
    document = [
        {
            "part": bar.part,
            "length_mm": round(bar.length_mm, 1),
            "pieces": [{"member": name, "length_mm": round(mm, 1)} for name, mm in bar.pieces],
            "rest_mm": round(bar.rest_mm, 1),
        }
        for bar in bars
    ]
    return as_json({"schema": "rigwright.stock/1", "bars": document})


def taps_csv(taps: Sequence[Tap]) -> str:
    """One line per member end whose core bores are tapped."""
    rows = ((t.member, t.end, t.bores, t.thread, f"{t.depth_mm:.1f}") for t in taps)
    return as_csv(TAP_COLUMNS, rows)


def taps_json(taps: Sequence[Tap]) -> str:
    """The same as JSON."""
    document = [vars(tap) | {"depth_mm": round(tap.depth_mm, 1)} for tap in taps]
    return as_json({"schema": "rigwright.taps/1", "taps": document})
