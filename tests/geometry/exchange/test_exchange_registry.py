"""Choosing an export and writing it."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from exchange_rigs import hand_rig
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from common.errors import ConflictError, InputError, NotFoundError
from geometry.exchange import FORMATS, ExportOptions, export_files, image_stem, write_export

REPO = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_makes_the_files_it_names(name: str, tmp_path: Path) -> None:
    if name == "usd":
        pytest.importorskip("pxr")
    form = FORMATS[name]
    cameras = hand_rig()
    stems = [image_stem(camera.name) for camera in cameras]
    told = {file.replace("{image}", stem) for file in form.files for stem in stems}
    written = write_export(tmp_path / name, name, cameras)
    assert set(written) == told
    assert {path.name for path in (tmp_path / name).iterdir()} == told
    assert [path.name for path in tmp_path.iterdir()] == [name], "nothing else stays"
    assert form.description and form.program


@pytest.mark.parametrize("name", FORMATS)
def test_the_document_tells_of_every_format(name: str) -> None:
    text = (REPO / "docs/how-to/exports.md").read_text(encoding="utf-8")
    assert f"`{name}`" in text
    for file in FORMATS[name].files:
        assert file.replace("{image}", "IMAGE") in text


def test_exports_are_the_same_every_time() -> None:
    for name in FORMATS:
        if name != "usd":
            assert export_files(name, hand_rig()) == export_files(name, hand_rig())


def test_a_wrong_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(NotFoundError, match="did you mean colmap-text"):
        export_files("colmap-txt", hand_rig())
    with pytest.raises(NotFoundError, match="choose one of colmap-text"):
        export_files("zzz", hand_rig())


def test_cameras_that_cannot_be_told_apart() -> None:
    one, other = hand_rig()
    with pytest.raises(InputError, match="share the image side_one"):
        export_files("gltf", (replace(one, name="side  one"), other))
    with pytest.raises(InputError, match="no cameras"):
        export_files("gltf", ())
    for name in ("../up", "a/b", ".hidden", "  "):
        with pytest.raises(InputError, match="cannot give its name"):
            export_files("realityscan", (replace(one, name=name),))


def test_wrong_options() -> None:
    with pytest.raises(InputError, match="ending"):
        ExportOptions(image_suffix="png")
    with pytest.raises(InputError, match="choose one of initial, exact, locked"):
        ExportOptions(pose_prior="free")
    files = export_files("colmap-text", hand_rig(), ExportOptions(image_suffix=".jpg"))
    assert b"front.jpg" in files["images.txt"]


def test_a_folder_in_use_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there/mine.txt").write_text("mine")
    with pytest.raises(ConflictError):
        write_export(tmp_path / "there", "gltf", hand_rig())
    assert [p.name for p in (tmp_path / "there").iterdir()] == ["mine.txt"]
    (tmp_path / "empty").mkdir()
    assert write_export(tmp_path / "empty", "gltf", hand_rig())["cameras.glb"].is_file()
    with pytest.raises(InputError, match="cannot write"):
        write_export(tmp_path / "there/mine.txt/below", "gltf", hand_rig())


def test_usd_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("pxr", "pxr.Gf", "pxr.Sdf", "pxr.Usd", "pxr.UsdGeom"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=r"rigwright\[usd\]"):
        export_files("usd", hand_rig())


def test_exporting_needs_no_heavy_library() -> None:
    code = "import sys, geometry.exchange; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=True
    )
    for heavy in ("cv2", "trimesh", "pydantic", "pxr", "pycolmap", "scipy"):
        assert heavy not in done.stdout.split()


@given(st.text(min_size=1, max_size=30))
def test_any_name_is_written_or_refused(name: str) -> None:
    """A hostile name breaks no file: the script still compiles, the XML still parses."""
    camera = replace(hand_rig()[0], name=name)
    try:
        files = export_files("blender", (camera,))
    except InputError as error:
        assert "\n" not in str(error)
        return
    compile(files["cameras_blender.py"], "script", "exec")
    etree.fromstring(export_files("metashape-xml", (camera,))["cameras.xml"])
