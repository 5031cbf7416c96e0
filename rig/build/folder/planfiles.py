"""Every file of a mount plan, each with what it is and how to make it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from geometry.raycast import Occluder
from rig.build import drawings, parts, wedges
from rig.build.drawings import Sheet
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.planfile import plan_document
from rig.build.mounts.structure import Plate
from rig.build.page.planscene import plan_glb
from rig.build.parts.screws import Tap, taps
from rig.catalogue import Catalogue, load_catalogue
from rig.report.designfolder import json_text

if TYPE_CHECKING:
    import trimesh

MEDIA_TYPES: Mapping[str, str] = {
    "json": "application/json",
    "csv": "text/csv; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "txt": "text/plain; charset=utf-8",
    "glb": "model/gltf-binary",
    "stl": "model/stl",
    "3mf": "model/3mf",
    "step": "model/step",
    "dxf": "image/vnd.dxf",
    "svg": "image/svg+xml",
    "pdf": "application/pdf",
}
SAFE = re.compile(r"[^A-Za-z0-9._-]+")


@dataclass(frozen=True)
class PlanFile:
    """One file of a plan: its path in the folder, what it is, and how to make it."""

    name: str
    words: str
    make: Callable[[], bytes]

    @property
    def media_type(self) -> str:
        """The media type, by its ending."""
        return MEDIA_TYPES[self.name.rpartition(".")[2]]


@dataclass(frozen=True, eq=False)
class PlanOptions:
    """What else the files are made from.

    ``occluder``: the subject, for the page and the scene. ``paper`` of templates: A4 or A3.
    ``step``: wedges as STEP too, with the extra ``cad``. ``stock``: the bars that pieces are sawn
    from.
    """

    catalogue: Catalogue = field(default_factory=load_catalogue)
    prices: parts.Prices = field(default_factory=parts.Prices)
    occluder: Occluder | None = None
    paper: str = "A4"
    step: bool = False
    stock: parts.Stock = field(default_factory=parts.Stock)


class _Making:
    """What several files of one plan share, made once and only when it is asked for."""

    def __init__(self, plan: MountPlan, options: PlanOptions) -> None:
        self.plan, self.options = plan, options
        self.words: dict[str, str] = {}
        self._printed: dict[str, tuple[wedges.PrintPart, trimesh.Trimesh]] = {}

    @cached_property
    def views(self) -> tuple[Sheet, ...]:
        occluder = self.options.occluder
        seen = occluder is not None and len(occluder.vertices_mm)
        return drawings.view_sheets(self.plan, occluder.vertices_mm if occluder and seen else None)

    @cached_property
    def isometric(self) -> tuple[Sheet, ...]:
        return drawings.isometric_sheets(self.plan, self.bill.lines)

    @cached_property
    def joints(self) -> tuple[Sheet, ...]:
        return drawings.exploded_sheets(self.plan, self.bill.lines, self.options.catalogue)

    @cached_property
    def settings(self) -> tuple[Sheet, ...]:
        return drawings.setting_sheets(self.plan)

    @cached_property
    def bill(self) -> parts.Bill:
        wedges = self.plan.structure.wedges
        volumes = {wedge.id: float(self.printed(k)[1].volume) for k, wedge in enumerate(wedges)}
        return parts.bill_of_materials(
            self.plan, self.options.catalogue, self.options.prices, volumes
        )

    @cached_property
    def cuts(self) -> tuple[parts.Cut, ...]:
        return parts.cut_list(self.plan, self.options.catalogue)

    @cached_property
    def bars(self) -> tuple[parts.Bar, ...]:
        return parts.stock_bars(self.plan, self.options.stock)

    @cached_property
    def taps(self) -> tuple[Tap, ...]:
        return taps(self.plan.structure, self.options.catalogue)

    def printed(self, index: int) -> tuple[wedges.PrintPart, trimesh.Trimesh]:
        """Recipe and mesh of a wedge."""
        wedge = self.plan.structure.wedges[index]
        if wedge.id not in self._printed:
            part = wedges.print_part(wedge, self.options.catalogue)
            self._printed[wedge.id] = part, wedges.wedge_mesh(part)
        return self._printed[wedge.id]

    def page(self) -> bytes:
        """The plan's page."""
        # Imported here: with plotly it costs a second that no other file needs.
        from rig.build.page.planpage import render_plan_page

        page = render_plan_page(self.plan, self.bill, self.cuts, self.options.occluder, self.words)
        return page.encode()


def plan_files(plan: MountPlan, options: PlanOptions | None = None) -> dict[str, PlanFile]:
    """Every file of a plan by its path in the folder; nothing is made before it is called."""
    making = _Making(plan, options or PlanOptions())
    files = [*_whole(making), *_lists(making), *_drawn(making), *_plates(making)]
    files += [*_setting_sheets(making), *_wedges(making)]
    making.words |= {file.name: file.words for file in files}
    return {file.name: file for file in files}


def _whole(making: _Making) -> Iterable[PlanFile]:
    plan = making.plan
    yield PlanFile("plan.json", "the plan itself", lambda: json_text(plan_document(plan)).encode())
    yield PlanFile("plan.html", "the plan's page", making.page)
    yield PlanFile("scene.glb", "the rig in 3D", lambda: plan_glb(plan, making.options.occluder))
    yield PlanFile(
        "steps.txt", "numbered assembly steps", lambda: drawings.steps_text(plan).encode()
    )


def _lists(making: _Making) -> Iterable[PlanFile]:
    plan = making.plan
    makers: dict[str, tuple[str, Callable[[], str]]] = {
        "parts/bill.csv": ("bill of materials", lambda: parts.bill_csv(making.bill)),
        "parts/bill.json": ("bill of materials", lambda: parts.bill_json(making.bill)),
        "parts/cuts.csv": ("cut list", lambda: parts.cuts_csv(making.cuts)),
        "parts/cuts.json": ("cut list", lambda: parts.cuts_json(making.cuts)),
        "parts/stock.csv": ("from which bars to saw", lambda: parts.stock_csv(making.bars)),
        "parts/stock.json": ("from which bars to saw", lambda: parts.stock_json(making.bars)),
        "parts/taps.csv": ("bores to tap", lambda: parts.taps_csv(making.taps)),
        "parts/taps.json": ("bores to tap", lambda: parts.taps_json(making.taps)),
        "parts/joints.csv": ("where joints are marked", lambda: parts.joints_csv(plan)),
        "parts/joints.json": ("where joints are marked", lambda: parts.joints_json(plan)),
        "settings/settings.csv": ("all settings", lambda: drawings.settings_csv(plan)),
        "settings/tapes.csv": ("all tape measures", lambda: drawings.tapes_csv(plan)),
        "settings/checks.csv": ("what shows on each camera", lambda: drawings.checks_csv(plan)),
        "settings/poses.csv": ("poses from the datum", lambda: drawings.poses_csv(plan)),
    }
    for name, (words, make) in makers.items():
        yield PlanFile(name, words, _encoded(make))


def _encoded(make: Callable[[], str]) -> Callable[[], bytes]:
    return lambda: make().encode()


def _sheets(
    name: str, words: str, title: str, make: Callable[[], Sequence[Sheet]]
) -> Iterable[PlanFile]:
    """A drawing in its three formats."""
    yield PlanFile(f"{name}.pdf", words, lambda: drawings.pdf_bytes(make(), title))
    yield PlanFile(f"{name}.svg", words, lambda: drawings.svg_bytes(make(), title))
    yield PlanFile(f"{name}.dxf", words, lambda: drawings.dxf_bytes(make()))


def _drawn(making: _Making) -> Iterable[PlanFile]:
    words = "front, top and side, cameras, members, joints"
    yield from _sheets("drawings/views", words, making.plan.name, lambda: making.views)
    words = "the rig with balloons that number it as the bill does"
    yield from _sheets("drawings/isometric", words, making.plan.name, lambda: making.isometric)
    if making.plan.structure.joints:
        words = "one joint of each kind, drawn apart"
        yield from _sheets("drawings/joints", words, making.plan.name, lambda: making.joints)


def _plates(making: _Making) -> Iterable[PlanFile]:
    plates = making.plan.structure.plates
    for plate, stem in zip(plates, _stems([plate.id for plate in plates]), strict=True):
        yield from _plate(making.plan.name, plate, f"drawings/plate-{stem}", making.options.paper)


def _plate(title: str, plate: Plate, name: str, paper: str) -> Iterable[PlanFile]:
    """Drawing and template of one plate. The template's PDF is for a printer, so it is tiled."""
    words = f"drilling template of plate {plate.id}, 1 : 1"
    template = f"{name}-template"
    yield from _sheets(
        name, f"plate {plate.id}, dimensioned", title, lambda: drawings.plate_sheets(title, plate)
    )
    yield PlanFile(
        f"{template}.pdf",
        f"{words}, to print at 100 %",
        lambda: drawings.pdf_bytes(drawings.template_pages(plate, paper), title),
    )
    yield PlanFile(
        f"{template}.svg",
        words,
        lambda: drawings.svg_bytes([drawings.template_sheet(plate)], title),
    )
    yield PlanFile(
        f"{template}.dxf", words, lambda: drawings.dxf_bytes([drawings.template_sheet(plate)])
    )


def _setting_sheets(making: _Making) -> Iterable[PlanFile]:
    plan = making.plan
    yield PlanFile(
        "settings/settings.pdf",
        "the setting sheets of all cameras",
        lambda: drawings.pdf_bytes(making.settings, plan.name),
    )
    words = "what inclinometer, picture and tape show on each camera"
    yield from _sheets("settings/checks", words, plan.name, lambda: drawings.check_sheets(plan))
    for index, stem in enumerate(_stems([mount.name for mount in plan.mounts])):
        words = f"setting sheet of {plan.mounts[index].name}"
        one = _picked(making, index)
        yield from _sheets(f"settings/sheet-{stem}", words, plan.name, one)


def _picked(making: _Making, index: int) -> Callable[[], tuple[Sheet, ...]]:
    return lambda: making.settings[index : index + 1]


def _wedges(making: _Making) -> Iterable[PlanFile]:
    placed = making.plan.structure.wedges
    for index, stem in enumerate(_stems([wedge.id for wedge in placed])):
        wedge = placed[index]
        words = f"printed wedge of {wedge.camera}, mm, lying as it is printed"
        made = {"stl": wedges.wedge_stl, "3mf": wedges.wedge_3mf}
        for ending, write in made.items():
            make = _printed(making, index, write)
            yield PlanFile(f"brackets/{stem}.{ending}", words, make)
        if making.options.step:
            yield PlanFile(f"brackets/{stem}.step", words, _stepped(making, index))


def _printed(
    making: _Making,
    index: int,
    write: Callable[[wedges.PrintPart, trimesh.Trimesh], bytes],
) -> Callable[[], bytes]:
    return lambda: write(*making.printed(index))


def _stepped(making: _Making, index: int) -> Callable[[], bytes]:
    return lambda: wedges.wedge_step(making.printed(index)[0])


def _stems(names: list[str]) -> list[str]:
    """Names as they may stand in any file system, each once whatever the case."""
    stems: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = SAFE.sub("-", name).strip("-.")[:80] or "unnamed"
        stem, number = plain, 2
        while stem.lower() in taken:
            stem, number = f"{plain}-{number}", number + 1
        taken.add(stem.lower())
        stems.append(stem)
    return stems
