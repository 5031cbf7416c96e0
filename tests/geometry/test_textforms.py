"""Text files that are right but that the usual readers garble, drop or call by strange words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from geometry.loading import RawScan, load_raw
from geometry.sniffing import check_file

CORNERS = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.5, 0.0]]


def loaded(path: Path, content: bytes | str) -> RawScan:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_raw(path, check_file(path))


@pytest.mark.parametrize("corner", ["{0}", "{0}/{0}", "{0}//{0}", "{0}/{0}/{0}"])
def test_indices_that_count_back_are_of_the_lines_before(tmp_path: Path, corner: str) -> None:
    lines = []
    for x in (0.0, 5.0):
        lines += [f"v {x + a} {b} 0\nvt {a} {b}\nvn 0 0 1" for a, b, _ in CORNERS]
        lines.append("f " + " ".join(corner.format(k) for k in (-3, -2, -1)))
    raw = loaded(tmp_path / "scan.obj", "\n".join(lines))
    x = raw.vertices[raw.faces][:, :, 0]
    np.testing.assert_allclose(np.sort(x, axis=1), [[0.0, 0.0, 1.5], [5.0, 5.0, 6.5]])


def test_an_index_before_the_first_vertex_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="counts back to before its first vertex"):
        loaded(tmp_path / "scan.obj", "v 0 0 0\nf -1 -2 -1\n")


def _strips(form: str, rows: list[list[int]]) -> bytes:
    head = (
        f"ply\nformat {form} 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
        f"property float z\nelement tristrips {len(rows)}\n"
        "property list int int vertex_indices\nend_header\n"
    )
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]]
    lists = [[len(row), *row] for row in rows]
    if form == "ascii":
        text = "\n".join(" ".join(str(v) for v in row) for row in points + lists)
        return (head + text + "\n").encode()
    numbers = [value for row in lists for value in row]
    return head.encode() + np.array(points, "<f4").tobytes() + np.array(numbers, "<i4").tobytes()


@pytest.mark.parametrize(
    ("form", "rows"),
    [
        ("ascii", [[0, 1, 2, 3, -1, 2, 3, 4]]),
        ("ascii", [[0, 1, 2, 3], [2, 3, 4]]),
        ("binary_little_endian", [[0, 1, 2, 3, -1, 2, 3, 4]]),
    ],
)
def test_triangle_strips_become_faces(tmp_path: Path, form: str, rows: list[list[int]]) -> None:
    raw = loaded(tmp_path / "scan.ply", _strips(form, rows))
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2], [2, 1, 3], [2, 3, 4]])


@pytest.mark.parametrize(
    ("form", "rows", "words"),
    [
        ("ascii", [[0, 1, 2, 9]], "strips are damaged"),
        ("binary_little_endian", [[0, 1, 2, 3], [2, 3, 4]], "in a form that is not read"),
    ],
)
def test_other_strips_are_refused(
    tmp_path: Path, form: str, rows: list[list[int]], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        loaded(tmp_path / "scan.ply", _strips(form, rows))


@pytest.mark.parametrize("between", [" ", "\t", ";", "; "])
def test_decimal_commas_are_read_where_they_can_be_nothing_else(
    tmp_path: Path, between: str
) -> None:
    rows = [between.join(str(v).replace(".", ",") for v in row) for row in CORNERS]
    np.testing.assert_allclose(loaded(tmp_path / "scan.xyz", "\n".join(rows)).vertices, CORNERS)


def test_commas_between_numbers_are_read_as_before(tmp_path: Path) -> None:
    for between in (",", ", "):
        text = "\n".join(between.join(str(v) for v in row) for row in CORNERS)
        np.testing.assert_allclose(loaded(tmp_path / "scan.csv", text).vertices, CORNERS)
        whole = between.join(["10", "20", "30"])
        assert loaded(tmp_path / "whole.csv", whole).vertices.tolist() == [[10.0, 20.0, 30.0]]


def test_decimal_commas_of_an_obj_are_read(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1,5 0,0 0\nv 0,0 1,5 0\nf 1 2 3\n"
    np.testing.assert_allclose(loaded(tmp_path / "scan.obj", text).vertices, CORNERS)


PLY_HEAD = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", "1,05,2,50,3,25\n4,10,5,07,6,00\n", "within its numbers and between them"),
        ("a.xyz", "1 2 3\nfour 5 6\n", "line 2 holds 'four 5 6', not numbers"),
        ("b.xyz", "1 2 3\n1 2\n", "line 2 has 2 numbers, the lines before have 3"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1,5 0 0\n0 1,5 0\n3 0 1 2\n", "commas for decimal points"),
        ("a.ply", PLY_HEAD + "0 0 0\n1,5 0 0\n0 1,5 0\n3 0 1 2\n", "commas for decimal points"),
        (
            "a.stl",
            "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1,5 0 0\n"
            "vertex 0 1,5 0\nendloop\nendfacet\nendsolid x\n",
            "commas for decimal points",
        ),
    ],
)
def test_numbers_that_cannot_be_read_are_named_in_plain_words(
    tmp_path: Path, name: str, content: str, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        loaded(tmp_path / name, content)
