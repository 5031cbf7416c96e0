"""From which bars the pieces of a plan are sawn."""

from __future__ import annotations

import math
from dataclasses import dataclass

from common.errors import InputError
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Member


@dataclass(frozen=True)
class Stock:
    """Bars are bought ``bar_mm`` long; a cut takes ``kerf_mm``."""

    bar_mm: float = 3000.0
    kerf_mm: float = 3.0

    def __post_init__(self) -> None:
        if not (self.bar_mm > 0.0 and 0.0 <= self.kerf_mm < self.bar_mm):
            raise InputError("stock", "bars cannot be sawn so", "give bar_mm above kerf_mm")


@dataclass(frozen=True)
class Bar:
    """A bar of a profile and the ``pieces`` (ids and lengths) sawn from it, longest first."""

    part: str
    length_mm: float
    pieces: tuple[tuple[str, float], ...]
    rest_mm: float


def stock_bars(plan: MountPlan, stock: Stock) -> tuple[Bar, ...]:
    """Every piece on a bar, the longest first, each on the first bar that has room.

    That takes at most 11/9 of the fewest bars and one more (Johnson 1973). A piece longer than a
    bar gets one of its own, of whole metres.
    """
    out: list[Bar] = []
    for part in dict.fromkeys(member.part for member in plan.structure.members):
        mine = [m for m in plan.structure.members if m.part == part]
        out += _bars(part, sorted(mine, key=lambda m: -m.long_side_mm), stock)
    return tuple(out)


def _bars(part: str, pieces: list[Member], stock: Stock) -> list[Bar]:
    bars: list[tuple[float, list[Member]]] = []
    rests: list[float] = []
    for piece in pieces:
        need = piece.long_side_mm + stock.kerf_mm
        place = next((k for k, rest in enumerate(rests) if rest >= need - 1e-9), None)
        if place is None:
            length = max(stock.bar_mm, math.ceil(need / 1000.0) * 1000.0)
            length = stock.bar_mm if need <= stock.bar_mm else length
            bars.append((length, []))
            rests.append(length)
            place = len(bars) - 1
        bars[place][1].append(piece)
        rests[place] -= need
    return [
        Bar(part, length, tuple((m.id, m.long_side_mm) for m in sawn), rest)
        for (length, sawn), rest in zip(bars, rests, strict=True)
    ]
