"""Tables on drawings, and sheets full of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.build.drawings.frame import A4_MM, BLOCK_MM, MARGIN_MM, Content, fitted
from rig.build.drawings.items import Item, Line, Text
from rig.build.drawings.pdf import text_width_mm

ROW_MM = 4.6
LINE_MM = 3.2
TEXT_MM = 2.1
PAD_MM = 1.5
HEAD_MM = 6.0
WIDEST_CELL_MM = 110.0
BETWEEN_MM = 8.0
"""Between two columns of tables."""

SHRUNK = 0.85
"""To what share of its width a table is narrowed so that it has a place beside another."""

NUMBER_LIKE = frozenset("0123456789.-+×°() ∞–")


@dataclass(frozen=True)
class Table:
    """A table with a heading. ``wraps``: words of the last column go on in further lines."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    wraps: bool = False

    def height_mm(self, most_mm: float = np.inf) -> float:
        """Height with its heading, where it may be so wide."""
        width = self.widths_mm(most_mm)[-1]
        more = sum(len(self.lines(row[-1], width)) - 1 for row in self.rows)
        return HEAD_MM + ROW_MM * (len(self.rows) + 1) + LINE_MM * more

    def lines(self, words: str, width_mm: float) -> list[str]:
        """The words of a last cell as lines that fit a column so wide."""
        if not self.wraps or not words:
            return [words]
        lines: list[str] = []
        for word in words.split():
            longer = f"{lines[-1]} {word}" if lines else word
            if lines and text_width_mm(longer, TEXT_MM) <= width_mm - 2.0 * PAD_MM:
                lines[-1] = longer
            else:
                lines.append(word)
        return lines

    def widths_mm(self, most_mm: float) -> list[float]:
        """Widths of the columns: what their words need, less when that is more than there is."""
        need = [
            max(
                text_width_mm(self.columns[k], TEXT_MM, bold=True),
                *(text_width_mm(row[k], TEXT_MM) for row in self.rows),
                0.0,
            )
            + 2.0 * PAD_MM
            for k in range(len(self.columns))
        ]
        need = [min(width, WIDEST_CELL_MM) for width in need]
        over = sum(need) - most_mm
        if over > 0.0 and self.wraps:
            need[-1] -= over
        elif over > 0.0:
            spare = [max(0.0, width - 14.0) for width in need]
            share = min(1.0, over / max(sum(spare), 1e-9))
            need = [width - share * room for width, room in zip(need, spare, strict=True)]
        return need


def table_items(table: Table, left: float, top: float, most_mm: float) -> list[Item]:
    """A table whose upper left corner is there."""
    widths = table.widths_mm(most_mm)
    edges = left + np.concatenate([[0.0], np.cumsum(widths)])
    items: list[Item] = [Text(table.title, left, top - 3.2, 2.6, bold=True)]
    y = top - HEAD_MM
    for index, row in enumerate((table.columns, *table.rows)):
        base = y - ROW_MM + 1.3
        *first, last = row
        lines = table.lines(last, widths[-1])
        for k, words in enumerate((*first, lines[0])):
            right = index > 0 and bool(words) and set(words) <= NUMBER_LIKE
            x = edges[k + 1] - PAD_MM if right else edges[k] + PAD_MM
            anchor = "end" if right else "start"
            cell = Text(words, float(x), base, TEXT_MM, anchor, bold=index == 0)
            items.append(fitted(cell, widths[k] - 2.0 * PAD_MM + 0.1))
        for k, words in enumerate(lines[1:], 1):
            items.append(Text(words, float(edges[-2] + PAD_MM), base - k * LINE_MM, TEXT_MM))
        y -= ROW_MM + LINE_MM * (len(lines) - 1)
        style = "mark" if index == 0 else "thin"
        items.append(Line(np.array([[left, y], [edges[-1], y]]), style))
    items.append(Line(np.array([[left, top - HEAD_MM], [edges[-1], top - HEAD_MM]]), "mark"))
    return items


def table_sheets(
    tables: Sequence[Table], title: str, size_mm: tuple[float, float] = A4_MM
) -> list[Content]:
    """Tables one below the other in columns, on as many sheets as they need."""
    sheets = _Columns(size_mm)
    for table in tables:
        rest = table
        while rest.rows:
            count = sheets.rows(rest)
            sheets.put(Table(rest.title, rest.columns, rest.rows[:count]))
            rest = Table(f"{table.title} (continued)", table.columns, rest.rows[count:])
    return [Content(title, size_mm, tuple(p), to_scale=False) for p in sheets.pages if p]


class _Columns:
    """Where the next table goes: below the last one, beside it, or on a new sheet."""

    def __init__(self, size_mm: tuple[float, float]) -> None:
        self.pages: list[list[Item]] = [[]]
        self._left, self._top = MARGIN_MM + 5.0, size_mm[1] - MARGIN_MM - 6.0
        self._right, self._bottom = size_mm[0] - MARGIN_MM - 5.0, MARGIN_MM + BLOCK_MM[1] + 6.0
        self._x, self._y, self._end = self._left, self._top, self._left

    def rows(self, table: Table) -> int:
        """How many rows of a table fit where it goes next; goes on where that is too few."""
        least = SHRUNK * self._wide(table)
        if self._room() < min(3, len(table.rows)) or self._x + least > self._right:
            self._x, self._y = self._end + BETWEEN_MM, self._top
            if self._x + least > self._right:
                self.pages.append([])
                self._x = self._end = self._left
        return self._room()

    def put(self, table: Table) -> None:
        """A table where it goes next."""
        wide = min(self._wide(table), self._right - self._x)
        self.pages[-1] += table_items(table, self._x, self._y, wide)
        self._y -= table.height_mm() + 6.0
        self._end = max(self._end, self._x + wide)

    def _wide(self, table: Table) -> float:
        return min(sum(table.widths_mm(np.inf)), self._right - self._left)

    def _room(self) -> int:
        return int((self._y - self._bottom - HEAD_MM) // ROW_MM) - 1
