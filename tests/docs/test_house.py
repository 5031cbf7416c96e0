"""The pictures of the house are those of the imports."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from service.reference.house import VIEWS, House, documents, import_graph, main, overview, svg, view

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "explanation"


def test_pictures_and_tables_of_the_house_are_up_to_date() -> None:
    for path, text in documents(FOLDER).items():
        assert path.read_text(encoding="utf-8") == text, (
            f"{path.name} is stale, run: python -m service.reference.house docs/explanation"
        )


def test_the_command_writes_them(tmp_path: Path) -> None:
    page = (FOLDER / "architecture.md").read_text(encoding="utf-8")
    (tmp_path / "architecture.md").write_text(page.replace("| floor |", "| flour |"), "utf-8")
    main(tmp_path)
    written = (tmp_path / "architecture.md").read_text(encoding="utf-8")
    assert "| floor |" in written and "| flour |" not in written
    assert len(list((tmp_path / "house").glob("*.svg"))) == len(VIEWS) + 1


@pytest.mark.parametrize("name", ["house", *VIEWS])
def test_every_room_stands_above_what_it_imports(name: str) -> None:
    graph = import_graph()
    house = overview(graph) if name == "house" else view(name, graph)
    level = {room: number for number, floor in enumerate(house.floors) for room in floor}
    assert house.arrows
    for high, low in house.arrows:
        assert level[high] > level[low] or (high, low) in house.circles


def test_packages_stand_in_no_circle() -> None:
    assert overview(import_graph()).circles == frozenset()


def test_a_circle_is_drawn_red_and_an_arrow_past_a_floor_ends_at_its_room() -> None:
    arrows = {("a", "b"): 2, ("b", "a"): 1, ("a", "c"): 1, ("c", "d"): 1, ("a", "d"): 5}
    house = House("x", (("d",), ("c",), ("a", "b")), arrows)
    assert house.circles == {("a", "b"), ("b", "a")}
    root = ET.fromstring(svg(house))  # noqa: S314 - our own text
    paths = {path.findtext("{*}title"): path for path in root.findall("{*}path")}
    assert len(paths) == 5
    assert paths["a imports b: 2"].get("stroke") == "#c22"
    assert paths["a imports d: 5"].get("stroke") != "#c22"
    boxes = {
        text.text: float(text.get("x", "nan"))
        for text in root.findall("{*}text")
        if text.get("text-anchor") == "middle"
    }
    last = (paths["a imports d: 5"].get("d") or "").split()
    assert float(last[-2]) == boxes["d"]
