"""A file is whole, or it is not: every beginning of it must be refused."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from camera_rigs import jpeg
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rig.acquisition.cameras.wholeness import (
    MEDIA_TYPES,
    _apart,
    _tiff_parts,
    has_gaps,
    is_whole,
)


def picture() -> np.ndarray:
    return np.random.default_rng(4).integers(0, 255, (9, 10, 3)).astype(np.uint8)


def encoded(suffix: str) -> bytes:
    return bytes(cv2.imencode(suffix, picture())[1].tobytes())


def jpeg_with_preview() -> bytes:
    """A small JPEG, end mark and all, within a segment of the large one."""
    small = cv2.imencode(".jpg", picture()[:8, :8])[1].tobytes()
    large = encoded(".jpg")
    return large[:2] + b"\xff\xe1" + struct.pack(">H", len(small) + 2) + small + large[2:]


def big_endian_raw() -> bytes:
    """A raw file as bodies write them: the picture hangs on a directory below the first."""
    data = bytes(range(64))
    sub = 8 + 2 + 12 + 4
    strip = sub + 2 + 24 + 4
    first = struct.pack(">HHHIII", 1, 330, 4, 1, sub, 0)
    second = struct.pack(">H", 2) + struct.pack(">HHII", 273, 4, 1, strip)
    second += struct.pack(">HHII", 279, 4, 1, len(data)) + struct.pack(">I", 0)
    return b"MM\0*" + struct.pack(">I", 8) + first + second + data


def boxes() -> bytes:
    def box(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I4s", 8 + len(body), kind) + body

    return box(b"ftyp", b"crx isom") + box(b"moov", b"x" * 30) + box(b"mdat", b"y" * 50)


def fuji() -> bytes:
    """A header that names three parts, and the parts."""
    header = b"FUJIFILMCCD-RAW ".ljust(84, b"\0") + struct.pack(">6I", 108, 20, 128, 12, 140, 50)
    return header + b"p" * 20 + b"h" * 12 + b"r" * 50


FILES = {
    "plain.jpg": encoded(".jpg"),
    "exif.JPG": jpeg("4711"),
    "preview.jpeg": jpeg_with_preview(),
    "a.png": encoded(".png"),
    "a.tif": encoded(".tiff"),
    "a.nef": big_endian_raw(),
    "a.cr3": boxes(),
    "a.raf": fuji(),
}


@pytest.mark.parametrize("name", FILES)
def test_whole_files_are_whole(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(FILES[name])
    assert is_whole(tmp_path / name)


@pytest.mark.parametrize("name", FILES)
def test_no_beginning_of_a_file_is_whole(name: str, tmp_path: Path) -> None:
    data, path = FILES[name], tmp_path / name
    path.write_bytes(data)
    for length in reversed(range(len(data))):
        os.truncate(path, length)
        assert not is_whole(path), length


@pytest.mark.parametrize("suffix", MEDIA_TYPES)
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=st.binary(max_size=64))
def test_noise_is_never_whole(suffix: str, noise: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"noise{suffix}"
    path.write_bytes(noise)
    assert not is_whole(path)


def test_a_tiff_that_leads_in_circles_ends(tmp_path: Path) -> None:
    path = tmp_path / "loop.tif"
    path.write_bytes(b"II*\0" + struct.pack("<IHI", 8, 0, 8))
    assert not is_whole(path)


def test_a_file_that_is_not_there_is_not_whole(tmp_path: Path) -> None:
    assert not is_whole(tmp_path / "gone.jpg")


def greedy(directories: int, strips: int, length: int) -> bytes:
    """A TIFF whose directories all name the same strips, each as long as the file."""
    ifd = 2 + 2 * 12 + 4
    arrays = 8 + directories * ifd
    out = b"II*\0" + struct.pack("<I", 8)
    for k in range(directories):
        out += struct.pack("<H", 2) + struct.pack("<HHII", 273, 4, strips, arrays)
        out += struct.pack("<HHII", 279, 4, strips, arrays + 4 * strips)
        out += struct.pack("<I", 0 if k == directories - 1 else 8 + (k + 1) * ifd)
    out += struct.pack("<I", 8) * strips + struct.pack("<I", length - 8) * strips
    return out.ljust(length, b"x")


def test_a_file_that_names_more_parts_than_a_picture_has_is_none(tmp_path: Path) -> None:
    path = tmp_path / "greedy.tif"
    path.write_bytes(greedy(60, 1 << 16, 1 << 20))
    assert not is_whole(path)


def test_parts_that_lie_on_one_another_are_looked_at_once(tmp_path: Path) -> None:
    """Else a megabyte would be read a thousand times, while all cameras of the folder wait."""
    path = tmp_path / "greedy.tif"
    path.write_bytes(greedy(1, 1000, 1 << 20))
    assert is_whole(path)
    with path.open("rb") as file:
        assert _apart(_tiff_parts(file, 1 << 20), 1 << 20) == [(8, 1 << 20)]
    assert not has_gaps(path)
