"""Draws the house from the imports: ``python -m service.reference.house docs/explanation``.

A picture shows a package: a box for each room (a module or package right below it), floors such
that every room stands above all that it imports, an arrow for each pair of rooms of which one
imports the other. Rooms that import each other in a circle share a floor, and their arrows are
red. The command writes ``house/PACKAGE.svg`` and renews the tables of rooms in
``architecture.md``.
"""

from __future__ import annotations

import ast
import re
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import escape

import grimp
import networkx as nx

PACKAGES = ("common", "geometry", "solver", "rig", "calibration", "evaluation", "service")
VIEWS = ("solver", "rig", "calibration", "service")
BOX_HEIGHT, FLOOR_HEIGHT, LETTER, GAP, MARGIN = 34, 92, 8.2, 26, 24


@dataclass(frozen=True)
class House:
    """The rooms of a package by floor, lowest first, and what imports what.

    ``arrows`` gives (importer, imported) with the number of imports of modules behind it.
    """

    name: str
    floors: tuple[tuple[str, ...], ...]
    arrows: dict[tuple[str, str], int]

    @property
    def circles(self) -> frozenset[tuple[str, str]]:
        """The arrows that are part of a circle."""
        parts = nx.strongly_connected_components(nx.DiGraph(list(self.arrows)))
        where = {room: number for number, part in enumerate(parts) for room in part}
        return frozenset(pair for pair in self.arrows if where[pair[0]] == where[pair[1]])

    @property
    def caption(self) -> str:
        """Counts of rooms, floors and arrows."""
        rooms = sum(len(floor) for floor in self.floors)
        return f"{self.name}: {rooms} rooms, {len(self.floors)} floors, {len(self.arrows)} arrows"


def present_packages() -> tuple[str, ...]:
    """The top-level packages of this version."""
    return tuple(name for name in PACKAGES if find_spec(name))


def import_graph() -> grimp.ImportGraph:
    """Who imports whom, of all modules."""
    first, *others = present_packages()
    return grimp.build_graph(first, *others, cache_dir=None)


def overview(graph: grimp.ImportGraph) -> House:
    """The whole: its rooms are the top-level packages."""
    return _house("Rigwright", {name: name for name in present_packages()}, graph)


def view(package: str, graph: grimp.ImportGraph) -> House:
    """One package: its rooms are the modules and packages right below it."""
    rooms = graph.find_children(package)
    return _house(package, {room: room.removeprefix(f"{package}.") for room in rooms}, graph)


def _house(name: str, rooms: dict[str, str], graph: grimp.ImportGraph) -> House:
    """``rooms``: module to the name of its room."""

    def room_of(module: str) -> str | None:
        parts = module.split(".")
        above = (".".join(parts[:depth]) for depth in range(len(parts), 0, -1))
        return next((rooms[place] for place in above if place in rooms), None)

    arrows: dict[tuple[str, str], int] = {}
    for module in sorted(graph.modules):
        for imported in sorted(graph.find_modules_directly_imported_by(module)):
            pair = (room_of(module), room_of(imported))
            if pair[0] and pair[1] and pair[0] != pair[1]:
                arrows[pair[0], pair[1]] = arrows.get((pair[0], pair[1]), 0) + 1
    return House(name, _floors(sorted(rooms.values()), arrows), arrows)


def _floors(rooms: list[str], arrows: dict[tuple[str, str], int]) -> tuple[tuple[str, ...], ...]:
    """Each room one floor above the highest that it imports."""
    graph = nx.DiGraph()
    graph.add_nodes_from(rooms)
    graph.add_edges_from((low, high) for high, low in arrows)
    blocks = nx.condensation(graph)
    return tuple(
        tuple(sorted(room for block in floor for room in blocks.nodes[block]["members"]))
        for floor in nx.topological_generations(blocks)
    )


# Importer, imported, floor: where a long arrow passes a floor.
Place = tuple[str, str, int]


def _rows(house: House) -> tuple[list[list[str | Place]], list[list[str | Place]]]:
    """Rooms and passing arrows of each floor, in an order with few crossings; each arrow's way."""
    floor_of = {room: level for level, floor in enumerate(house.floors) for room in floor}
    rows: list[list[str | Place]] = [list(floor) for floor in house.floors]
    ways: list[list[str | Place]] = []
    for high, low in house.arrows:
        between = range(floor_of[high] - 1, floor_of[low], -1)
        passes: list[str | Place] = [(high, low, level) for level in between]
        for level, place in zip(between, passes, strict=True):
            rows[level].append(place)
        ways.append([high, *passes, low])
    neighbours = nx.Graph(pair for way in ways for pair in pairwise(way))
    for sweep in range(12):
        for row in rows if sweep % 2 else reversed(rows):
            at = {
                place: _middle(other, number)
                for other in rows
                for number, place in enumerate(other)
            }

            def pull(place: str | Place, at: dict[str | Place, float] = at) -> tuple[float, str]:
                near = [at[n] for n in neighbours[place]] if place in neighbours else [at[place]]
                return sum(near) / len(near), str(place)

            row.sort(key=pull)
    return rows, ways


def _middle(row: list[str | Place], number: int) -> float:
    """Where in a row something stands, 0 to 1."""
    return (number + 0.5) / len(row)


def _width(place: str | Place) -> float:
    return LETTER * len(place) + 20 if isinstance(place, str) else 6.0


def svg(house: House) -> str:
    """The picture."""
    rows, ways = _rows(house)
    spans = [sum(_width(place) + GAP for place in row) - GAP for row in rows]
    wide = max(max(spans), LETTER * len(house.caption)) + 2 * MARGIN
    high = FLOOR_HEIGHT * len(rows) + MARGIN
    at: dict[str | Place, tuple[float, float]] = {}
    for level, (row, span) in enumerate(zip(rows, spans, strict=True)):
        x = (wide - span) / 2
        for place in row:
            at[place] = (x + _width(place) / 2, high - FLOOR_HEIGHT * (level + 0.5))
            x += _width(place) + GAP
    lines = [_arrow(house, way, at) for way in ways]
    boxes = [_box(room, at[room]) for floor in house.floors for room in floor]
    return "\n".join(
        [_HEAD.format(wide=wide, high=high, caption=house.caption), *lines, *boxes, "</svg>\n"]
    )


_HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {high:.0f}" \
width="{wide:.0f}" font-family="sans-serif" font-size="14">
<rect width="100%" height="100%" fill="#fff"/>
<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" \
orient="auto"><path d="M0 0 L8 4 L0 8 z" fill="context-stroke"/></marker></defs>
<text x="12" y="22" fill="#555">{caption}</text>"""


def _arrow(house: House, way: list[str | Place], at: dict[str | Place, tuple[float, float]]) -> str:
    """An arrow from room to room, past the rooms between them."""
    (x0, y0), *between, (x1, y1) = [at[place] for place in way]
    high, low = str(way[0]), str(way[-1])
    if y0 == y1:
        top = y0 - BOX_HEIGHT / 2
        path = f"M{x0:.1f} {top:.1f} Q{(x0 + x1) / 2:.1f} {top - BOX_HEIGHT:.1f} {x1:.1f} {top:.1f}"
    else:
        points = [(x0, y0 + BOX_HEIGHT / 2), *between, (x1, y1 - BOX_HEIGHT / 2)]
        path = f"M{points[0][0]:.1f} {points[0][1]:.1f}" + "".join(map(_bend, points, points[1:]))
    colour = "#c22" if (high, low) in house.circles else "#7a8aa0"
    words = f"{high} imports {low}: {house.arrows[high, low]}"
    return (
        f'<path d="{path}" fill="none" stroke="{colour}" marker-end="url(#tip)">'
        f"<title>{escape(words)}</title></path>"
    )


def _bend(upper: tuple[float, float], lower: tuple[float, float]) -> str:
    """From one point down to another, upright at both."""
    half = (upper[1] + lower[1]) / 2
    return f" C{upper[0]:.1f} {half:.1f} {lower[0]:.1f} {half:.1f} {lower[0]:.1f} {lower[1]:.1f}"


def _box(room: str, centre: tuple[float, float]) -> str:
    wide = _width(room)
    return (
        f'<rect x="{centre[0] - wide / 2:.1f}" y="{centre[1] - BOX_HEIGHT / 2:.1f}" '
        f'width="{wide:.1f}" height="{BOX_HEIGHT}" rx="5" fill="#eef3fa" stroke="#456"/>'
        f'<text x="{centre[0]:.1f}" y="{centre[1] + 5:.1f}" text-anchor="middle">'
        f"{escape(room)}</text>"
    )


def first_sentence(module: str) -> str:
    """The first sentence of a module's docstring."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    words = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return re.split(r"(?<=[.?!])\s", " ".join(words.replace("``", "`").split()), maxsplit=1)[0]


def room_table(house: House, package: str) -> str:
    """The rooms of a package, highest floor first, as a Markdown table."""
    prefix = "" if house.name == "Rigwright" else f"{package}/"
    rows = [
        f"| {level} | `{prefix}{room}` | {first_sentence(f'{prefix}{room}'.replace('/', '.'))} |"
        for level, floor in reversed(list(enumerate(house.floors)))
        for room in floor
    ]
    return "\n".join(["| floor | room | what |", "| --- | --- | --- |", *rows])


def documents(folder: Path) -> dict[Path, str]:
    """What each generated file in the folder ``folder`` should hold."""
    graph = import_graph()
    houses = {"house": overview(graph)} | {name: view(name, graph) for name in VIEWS}
    page = folder / "architecture.md"
    text = page.read_text(encoding="utf-8")
    for name, house in houses.items():
        begin, end = f"<!-- rooms of {name} -->", "<!-- end of rooms -->"
        table = f"{begin}\n{house.caption}.\n\n{room_table(house, name)}\n{end}"
        before, _, rest = text.partition(begin)
        text = before + table + rest.partition(end)[2]
    pictures = {folder / "house" / f"{name}.svg": svg(house) for name, house in houses.items()}
    return {page: text, **pictures}


def main(folder: Path) -> None:
    """Write the generated files."""
    (folder / "house").mkdir(parents=True, exist_ok=True)
    for path, text in documents(folder).items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/explanation"))
