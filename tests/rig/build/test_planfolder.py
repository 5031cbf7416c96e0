"""The plan folder: whole or not there, with a manifest that is true, and as one archive."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from plans import plate_plan, tslot_plan
from rigs import ellipsoid_mesh

from common.errors import CancelledError, ConflictError, InputError
from common.progress import Progress
from geometry.raycast import Occluder
from rig.build.folder.planfiles import MEDIA_TYPES, PlanOptions, plan_files
from rig.build.folder.planfolder import MANIFEST, write_plan
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.planfile import read_plan
from rig.build.page.planscene import plan_glb
from rig.build.parts import Prices


@cache
def plate() -> MountPlan:
    return plate_plan()


def test_a_folder_holds_every_file_and_a_true_manifest(tmp_path: Path) -> None:
    seen: list[Progress] = []
    out = tmp_path / "plan"
    paths = write_plan(plate(), out, progress=seen.append)
    there = {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert there == set(paths) == {*plan_files(plate()), MANIFEST}
    for wanted in (
        "plan.json",
        "plan.html",
        "scene.glb",
        "steps.txt",
        "drawings/views.dxf",
        "drawings/plate-plate.svg",
        "drawings/plate-plate-template.pdf",
        "settings/settings.pdf",
        "settings/sheet-left.dxf",
        "parts/bill.csv",
        "parts/stock.csv",
        "parts/taps.json",
        "drawings/isometric.pdf",
        "drawings/joints.pdf",
        "brackets/wedge-top.3mf",
    ):
        assert wanted in there
    for entry in json.loads((out / MANIFEST).read_text("utf-8"))["files"]:
        data = (out / entry["name"]).read_bytes()
        assert entry["bytes"] == len(data) > 0
        assert entry["sha256"] == hashlib.sha256(data).hexdigest()
        assert entry["media_type"] in MEDIA_TYPES.values() and entry["what"]
    fractions = [p.fraction for p in seen]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert read_plan(out / "plan.json").mounts[0].values() == plate().mounts[0].values()
    assert list(tmp_path.iterdir()) == [out]


def test_a_former_plan_is_replaced_and_other_files_are_safe(tmp_path: Path) -> None:
    out = tmp_path / "plan"
    write_plan(plate(), out)
    write_plan(tslot_plan(2), out)
    assert not (out / "brackets").exists() and (out / "settings/sheet-c1.pdf").exists()
    (out / "settings" / "mine.txt").write_text("notes")
    with pytest.raises(ConflictError, match=r"settings/mine\.txt"):
        write_plan(plate(), out)
    assert (out / "settings/sheet-c1.pdf").exists()


def test_a_cancelled_or_impossible_plan_leaves_nothing(tmp_path: Path) -> None:
    class After:
        asked = 0

        def is_set(self) -> bool:
            self.asked += 1
            return self.asked > 3

    with pytest.raises(CancelledError):
        write_plan(plate(), tmp_path / "plan", cancel=After())
    wedge = replace(plate().structure.wedges[0], camera="M" * 90)
    bad = replace(plate(), structure=replace(plate().structure, wedges=(wedge,)))
    with pytest.raises(InputError, match="shorter name"):
        write_plan(bad, tmp_path / "plan")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("x")
    with pytest.raises(ConflictError, match="not a folder"):
        write_plan(plate(), tmp_path / "file")


def test_the_files_are_the_same_each_time() -> None:
    def made() -> dict[str, bytes]:
        """All but the page, which takes as long as the rest."""
        return {k: f.make() for k, f in plan_files(plate()).items() if not k.endswith("html")}

    assert made() == made()


def test_names_cannot_leave_the_folder_or_meet() -> None:
    plan = tslot_plan(3)
    names = ("../../evil", "A b", "a/b")
    mounts = tuple(
        replace(m, camera=replace(m.camera, name=name))
        for m, name in zip(plan.mounts, names, strict=True)
    )
    found = plan_files(replace(plan, mounts=mounts))
    sheets = [name for name in found if name.startswith("settings/sheet-") and name.endswith("pdf")]
    assert sheets == [
        "settings/sheet-evil.pdf",
        "settings/sheet-A-b.pdf",
        "settings/sheet-a-b-2.pdf",
    ]


def test_prices_and_step_are_options() -> None:
    options = PlanOptions(prices=Prices("EUR", {"hex-nut-m5": 0.1}), step=True)
    found = plan_files(plate(), options)
    bill = json.loads(found["parts/bill.json"].make())
    assert bill["total"]["cost"] == pytest.approx(0.6) and bill["total"]["currency"] == "EUR"
    assert "brackets/wedge-top.step" in found
    masses = {x["part"]: x["mass_g"] for x in bill["lines"] if x["kind"] == "wedge"}
    assert all(20.0 < mass < 100.0 for mass in masses.values()), "PETG, 20 to 80 cm3"


def test_the_scene_has_a_node_for_every_part() -> None:
    vertices, faces = ellipsoid_mesh(20, 30)
    scene = trimesh.load_scene(
        io.BytesIO(plan_glb(plate(), Occluder(vertices, faces))), file_type="glb"
    )
    nodes = set(scene.graph.nodes_geometry)
    assert {"head", "left/body", "top/view", "plate/plate", "wedge/wedge-left"} <= nodes
    transform, name = scene.graph.get("wedge/wedge-top")
    corners = scene.geometry[name].vertices @ transform[:3, :3].T + transform[:3, 3]
    wanted = next(s for s in plate().structure.solids if s.owner == "wedge-top").corners_mm / 1000.0
    # glTF: metres, +Y up, +Z to the front: x, z, -y. GLB keeps single precision.
    y_up = np.column_stack([wanted[:, 0], wanted[:, 2], -wanted[:, 1]])
    assert corners.min(axis=0) == pytest.approx(y_up.min(axis=0), abs=1e-6)
    assert corners.max(axis=0) == pytest.approx(y_up.max(axis=0), abs=1e-6)


def test_steps_are_numbered_once() -> None:
    numbered = replace(tslot_plan(2), steps=("1. Cut.", "2. Join."))
    text = plan_files(numbered)["steps.txt"].make().decode()
    assert "1. Cut.\n2. Join.\n" in text and "1. 1." not in text


def test_the_docs_name_every_kind_of_file() -> None:
    text = (Path(__file__).resolve().parents[3] / "docs/reference/drawings.md").read_text("utf-8")
    for name in (*plan_files(plate(), PlanOptions(step=True)), MANIFEST):
        folder, _, file = name.rpartition("/")
        stem, _, ending = file.rpartition(".")
        kinds = {"sheet-": "sheet-CAMERA", "wedge-": "WEDGE", "plate-": "plate-ID"}
        shown = next((v for k, v in kinds.items() if stem.startswith(k)), stem)
        shown += "-template" if stem.endswith("-template") else ""
        prefix = f"{folder}/" if folder else ""
        wanted = (f"`{prefix}{shown}.{ending}`", f"`{prefix}{shown}.*`", f"`{shown}.{ending}`")
        known = any(word in text for word in wanted) or (
            shown == "WEDGE" and f"`.{ending}`" in text
        )
        assert known, name
