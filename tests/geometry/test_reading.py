"""Reading scans: every format, every bad file with one clear error."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scanfiles import plain_head

from common.errors import InputError, NotFoundError, RigwrightError, TooLargeError
from geometry.reading import read_scan
from geometry.scan import Scan
from geometry.scanoptions import ScanOptions
from geometry.sniffing import KINDS

OBJECT = ScanOptions(subject="object", units="mm")
IN_RIG_FRAME = ScanOptions(subject="object", units="mm", up="+z", front="-y")
"""Where the face is is not asked: to find it takes longer than to read the file."""


def kinds_of(scan: Scan) -> set[str]:
    return {note.kind for note in scan.notes}


def texts_of(scan: Scan) -> str:
    return " / ".join(note.text for note in scan.notes)


def rejected(path: Path, options: ScanOptions = OBJECT) -> InputError:
    with pytest.raises(InputError) as caught:
        read_scan(path, options)
    assert "\n" not in str(caught.value)
    assert len(caught.value.remedy) > 10
    return caught.value


def save(tmp_path: Path, name: str, content: bytes | str) -> Path:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("extension", ["glb", "gltf", "obj", "ply", "stl", "3mf", "off"])
def test_every_mesh_format_gives_the_same_surface(tmp_path: Path, extension: str) -> None:
    head = plain_head()
    path = tmp_path / f"head.{extension}"
    if extension == "gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(head)).items():
            (tmp_path / name).write_bytes(data)
        path = tmp_path / "model.gltf"
    else:
        head.export(path)
    scan = read_scan(path, IN_RIG_FRAME)
    # float32 resolves 130 mm to 1e-5 mm and text formats keep eight digits; welding may merge a
    # few vertices of the flat cut.
    assert np.allclose(scan.extents_mm, head.extents, atol=1e-3)
    volume = trimesh.Trimesh(scan.vertices_mm, scan.faces, process=False).volume
    assert volume == pytest.approx(head.volume, rel=1e-5)


def test_formats_that_split_seams_are_welded_closed(tmp_path: Path) -> None:
    plain_head().export(tmp_path / "head.stl")
    scan = read_scan(tmp_path / "head.stl", IN_RIG_FRAME)
    assert trimesh.Trimesh(scan.vertices_mm, scan.faces, process=False).is_watertight
    assert "changed" in kinds_of(scan)
    assert "welded" in texts_of(scan)


def test_scene_graph_is_laid_out_with_its_transforms(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    box = trimesh.creation.box(extents=(1.0, 1.0, 1.0))
    scene.add_geometry(box, node_name="left")
    scene.add_geometry(
        box, node_name="far", transform=trimesh.transformations.translation_matrix([9, 0, 0])
    )
    scene.export(tmp_path / "two.glb")
    scan = read_scan(
        tmp_path / "two.glb", ScanOptions(subject="object", units="mm", up="+z", front="-y")
    )
    assert scan.extents_mm == pytest.approx([10.0, 1.0, 1.0], abs=1e-6)


def test_mirrored_parts_still_face_outward(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene.add_geometry(trimesh.creation.icosphere(), transform=mirror)
    scene.export(tmp_path / "mirrored.glb")
    scan = read_scan(tmp_path / "mirrored.glb", OBJECT)
    assert (np.einsum("ij,ij->i", scan.normals, scan.vertices_mm) > 0.0).all()


@pytest.mark.parametrize("separator", [" ", ",", ";", "\t", ", "])
def test_text_points_with_normals(tmp_path: Path, separator: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    rows = np.hstack([50.0 * ball.vertices, ball.vertices])
    lines = [separator.join(f"{v:.9f}" for v in row) for row in rows]
    path = save(tmp_path, "ball.xyz", "\n".join(["# a ball", "", *lines]))
    scan = read_scan(path, OBJECT)
    assert scan.is_cloud
    assert len(scan.vertices_mm) == len(ball.vertices)
    assert np.allclose(scan.normals, scan.vertices_mm / 50.0, atol=1e-6)


def test_clouds_without_normals_get_outward_ones(tmp_path: Path) -> None:
    head = plain_head()
    points, _ = trimesh.sample.sample_surface_even(head, 8000, seed=1)
    trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    scan = read_scan(tmp_path / "cloud.ply", IN_RIG_FRAME)
    _, _, nearest = trimesh.proximity.closest_point(head, scan.vertices_mm)
    outward = np.einsum("ij,ij->i", scan.normals, head.face_normals[nearest])
    # Neighbourhoods that bend over the edge of the flat cut may choose either side of it.
    assert np.mean(outward > 0.0) > 0.995
    assert "normals" in texts_of(scan)


def test_a_cloud_hides_what_is_behind_it(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=100.0)
    trimesh.PointCloud(ball.vertices).export(tmp_path / "ball.ply")
    scan = read_scan(tmp_path / "ball.ply", OBJECT)
    eye = np.array([0.0, -1000.0, 0.0])
    hidden = scan.occluder().hidden(scan.vertices_mm, scan.normals, eye)
    facing = np.einsum("ij,ij->i", scan.normals, eye - scan.vertices_mm)
    facing /= np.linalg.norm(eye - scan.vertices_mm, axis=1)
    # A start lifted by h sees over the horizon of a ball of radius R as far as cos = R / (R + h);
    # 0.05 more for the squares' edges, which are not round.
    over = np.sqrt(1.0 - (100.0 / (100.0 + scan.occluder().lift_mm)) ** 2) + 0.05
    assert not hidden[facing > 0.0].any()
    assert hidden[facing < -over].all()


def test_ply_cloud_keeps_its_normals(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10.0)
    names = ("x", "y", "z", "nx", "ny", "nz")
    header = ["ply", "format ascii 1.0", f"element vertex {len(ball.vertices)}"]
    header += [f"property float {name}" for name in names] + ["end_header"]
    rows = [" ".join(map(str, row)) for row in np.hstack([ball.vertices, ball.vertices / 10.0])]
    scan = read_scan(save(tmp_path, "ball.ply", "\n".join([*header, *rows, ""])), OBJECT)
    assert "normals" not in texts_of(scan)
    assert np.allclose(scan.normals, scan.vertices_mm / 10.0, atol=1e-5)


def test_rig_from_file_maps_the_file_to_the_scan(tmp_path: Path) -> None:
    head = plain_head()
    head.apply_transform([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    head.export(tmp_path / "head.ply")
    scan = read_scan(tmp_path / "head.ply", ScanOptions(up="+y", front="-x", scale=2.0))
    mapped = head.vertices @ scan.rig_from_file[:3, :3].T + scan.rig_from_file[:3, 3]
    assert np.allclose(mapped.min(axis=0), scan.vertices_mm.min(axis=0), atol=1e-3)
    assert np.allclose(mapped.max(axis=0), scan.vertices_mm.max(axis=0), atol=1e-3)


@pytest.mark.parametrize("extension", sorted(KINDS))
def test_an_empty_file_is_refused(tmp_path: Path, extension: str) -> None:
    assert rejected(save(tmp_path, f"scan{extension}", b"")).detail == "scan-empty"


def test_a_missing_file_and_an_unknown_kind_are_named(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError):
        read_scan(tmp_path / "none.glb")
    assert rejected(save(tmp_path, "scan.fbx", b"x")).detail == "scan-format"


def test_points_that_are_all_nan_are_refused_and_a_few_are_dropped(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3).vertices.copy()
    lines = [" ".join(map(str, row)) for row in ball]
    lines[5] = "nan 0 0"
    scan = read_scan(save(tmp_path, "few.xyz", "\n".join(lines)), OBJECT)
    assert len(scan.vertices_mm) == len(ball) - 1
    assert "1 vertices that are NaN" in texts_of(scan)
    lines = ["nan nan nan"] * 200
    assert rejected(save(tmp_path, "all.xyz", "\n".join(lines))).detail == "scan-not-finite"


def test_huge_coordinates_are_refused(tmp_path: Path) -> None:
    head = plain_head()
    head.apply_translation([2e6, 0.0, 0.0])
    head.export(tmp_path / "far.obj")
    assert rejected(tmp_path / "far.obj", IN_RIG_FRAME).detail == "scan-coordinates"
    text = "v 1e300 0 0\nv 0 1e300 0\nv 0 0 1e300\nf 1 2 3\n"
    assert rejected(save(tmp_path, "huge.obj", text)).detail == "scan-coordinates"


def test_faces_without_area_and_a_file_without_faces_are_refused(tmp_path: Path) -> None:
    flat = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"
    assert rejected(save(tmp_path, "flat.obj", flat)).detail == "scan-zero-area"
    spot = "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n"
    assert rejected(save(tmp_path, "spot.obj", spot)).detail == "scan-zero-area"
    assert isinstance(rejected(save(tmp_path, "none.obj", "# nothing\n")), InputError)


def test_non_manifold_edges_are_read_with_a_warning(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nv 0 -9 3\nf 1 2 3\nf 2 1 4\nf 1 2 5\n"
    scan = read_scan(save(tmp_path, "fin.obj", text), OBJECT)
    assert len(scan.faces) == 3
    assert "non-manifold" in texts_of(scan)


@pytest.mark.parametrize("format_name", ["ascii", "binary_little_endian"])
def test_ten_million_declared_faces_are_refused_from_the_ply_header(
    tmp_path: Path, format_name: str
) -> None:
    header = f"ply\nformat {format_name} 1.0\nelement vertex 3\nelement face 10000000\nend_header\n"
    error = rejected(save(tmp_path, "big.ply", header))
    assert isinstance(error, TooLargeError)
    assert error.detail == "scan-faces"
    assert "decimate" in error.remedy


def test_ten_million_declared_faces_are_refused_in_stl_off_and_glb(tmp_path: Path) -> None:
    stl = b"\0" * 80 + struct.pack("<I", 10_000_000) + b"\0" * 100
    assert rejected(save(tmp_path, "big.stl", stl)).detail == "scan-faces"
    assert rejected(save(tmp_path, "big.off", "OFF\n3 10000000 0\n")).detail == "scan-faces"
    document = {
        "asset": {"version": "2.0"},
        "accessors": [{"count": 3}, {"count": 30_000_003}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }
    assert rejected(save(tmp_path, "big.glb", glb_bytes(document))).detail == "scan-faces"


def glb_bytes(document: dict[str, Any]) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text


def test_a_file_of_two_gigabytes_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "sparse.ply"
    with path.open("wb") as file:
        file.truncate(2 << 30)
    error = rejected(path)
    assert isinstance(error, TooLargeError)
    assert error.detail == "scan-file-size"


def test_a_zip_renamed_glb_is_named_for_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "scan.glb"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("scan.obj", "v 0 0 0")
    error = rejected(path)
    assert error.detail == "scan-format"
    assert "ZIP archive, not GLB" in error.problem
    path.rename(tmp_path / "scan.3mf")
    assert "without a 3D model" in rejected(tmp_path / "scan.3mf").problem


def test_a_three_mf_that_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    # Objects of two parts each, thirty deep: a billion copies of one triangle.
    nested = "".join(
        f'<object id="{k}"><components><component objectid="{k - 1}"/>'
        f'<component objectid="{k - 1}"/></components></object>'
        for k in range(2, 32)
    )
    model = (
        '<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        '<object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
        '<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/>'
        f"</triangles></mesh></object>{nested}</resources>"
        '<build><item objectid="31"/></build></model>'
    )
    path = tmp_path / "bomb.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    assert rejected(path).detail == "scan-faces"


def test_a_small_three_mf_that_unpacks_to_very_much_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "blank.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b"<model>" + b" " * (80 << 20))
    error = rejected(path)
    assert isinstance(error, TooLargeError)
    assert error.detail == "scan-growth"


def test_a_three_mf_of_too_many_vertices_is_not_unpacked_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("geometry.containers.MAX_SHARED_POINTS", 1000)
    path = tmp_path / "many.3mf"
    # Beyond the limit the archive is broken, which nobody comes to see.
    vertices = b'<vertex x="0" y="0" z="0"/>' * 2000
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", vertices + bytes(8 << 20) + b"<!DOCTYPE")
    error = rejected(path)
    assert isinstance(error, TooLargeError)
    assert (error.detail, "1,000 vertices" in error.problem) == ("scan-points", True)


@pytest.mark.parametrize(
    "uri",
    ["../secret.bin", "/etc/passwd", "http://example.com/a.bin", "a/%2e%2e/../b.bin", "C:\\x.bin"],
)
def test_references_out_of_the_folder_are_refused(tmp_path: Path, uri: str) -> None:
    document = {"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 12}]}
    path = save(tmp_path, "model.gltf", json.dumps(document))
    assert rejected(path).detail == "scan-reference"


def test_nodes_with_two_parents_are_refused(tmp_path: Path) -> None:
    document = {"asset": {"version": "2.0"}, "nodes": [{"children": [1, 1]}, {"children": []}]}
    assert rejected(save(tmp_path, "model.gltf", json.dumps(document))).detail == "scan-format"


@pytest.mark.parametrize(
    "wrong",
    [{"units": "feet"}, {"scale": 0.0}, {"scale": float("nan")}, {"up": "y"}, {"subject": "cat"},
     {"up": "+y", "front": "-y"}],
)  # fmt: skip
def test_options_check_themselves(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        ScanOptions(**wrong)


STARTS = {
    ".glb": b"glTF\x02\0\0\0",
    ".gltf": b'{"asset":{"version":"2.0"},',
    ".obj": b"v 0 0 0\nf 1 1 1\n",
    ".ply": b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n",
    ".stl": b"solid x\nfacet normal 0 0 1\n",
    ".3mf": b"PK\x03\x04",
    ".off": b"OFF\n3 1 0\n",
    ".xyz": b"0 0 0\n1 1 1\n",
}


@pytest.mark.parametrize("extension", sorted(STARTS))
@settings(max_examples=40, deadline=None, derandomize=True,
          suppress_health_check=[HealthCheck.function_scoped_fixture])  # fmt: skip
@given(tail=st.binary(max_size=300), real_start=st.booleans())
def test_random_bytes_give_no_other_error(
    tmp_path: Path, extension: str, tail: bytes, real_start: bool
) -> None:
    path = save(tmp_path, f"noise{extension}", (STARTS[extension] if real_start else b"") + tail)
    try:
        scan = read_scan(path, OBJECT)
    except RigwrightError as error:
        assert "\n" not in str(error)
    else:
        assert len(scan.vertices_mm) > 0


@pytest.mark.parametrize("extension", [".glb", ".obj", ".ply", ".stl", ".3mf", ".off"])
@settings(max_examples=40, deadline=None, derandomize=True,
          suppress_health_check=[HealthCheck.function_scoped_fixture])  # fmt: skip
@given(data=st.data())
def test_damaged_files_give_no_other_error(
    tmp_path: Path, extension: str, data: st.DataObject
) -> None:
    sound = tmp_path / f"sound{extension}"
    if not sound.exists():
        trimesh.creation.icosphere(subdivisions=1).export(sound)
    content = bytearray(sound.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = save(tmp_path, f"damaged{extension}", bytes(content))
    try:
        scan = read_scan(path, OBJECT)
    except RigwrightError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(scan.vertices_mm).all()
