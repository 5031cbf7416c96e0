from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.acquisition.cameras.pixels import decode, understood

SIZES = st.tuples(st.integers(1, 9), st.integers(1, 9))


def ramp(width: int, height: int, bits: int) -> np.ndarray:
    values = np.random.default_rng(width * 100 + height).integers(0, 2**bits, (height, width))
    return values.astype(np.uint16)


@given(SIZES, st.sampled_from([10, 12, 14, 16]))
def test_unpacked_values_fill_16_bits(size: tuple[int, int], bits: int) -> None:
    values = ramp(*size, bits)
    image = decode(f"Mono{bits}", *size, values.astype("<u2").tobytes())
    assert image.dtype == np.uint16
    assert np.array_equal(image >> (16 - bits), values)


@given(SIZES, st.sampled_from([10, 12, 14]))
def test_packed_values_are_those_packed(size: tuple[int, int], bits: int) -> None:
    values = ramp(*size, bits)
    # The definition of the PFNC's p formats: one stream of bits, lowest bit of each sample first.
    total = sum(int(value) << (bits * k) for k, value in enumerate(values.ravel()))
    packed = total.to_bytes((values.size * bits + 7) // 8, "little")
    assert np.array_equal(decode(f"Mono{bits}p", *size, packed) >> (16 - bits), values)


@pytest.mark.parametrize(
    ("name", "pixel"),
    [("RGB8", b"\1\2\3"), ("BGR8", b"\3\2\1"), ("RGBa8", b"\1\2\3\xff"), ("BGRa8", b"\3\2\1\xff")],
)
def test_colours_come_out_red_first(name: str, pixel: bytes) -> None:
    image = decode(name, 2, 3, pixel * 6)
    assert image.shape == (3, 2, 3)
    assert (image == [1, 2, 3]).all()


@pytest.mark.parametrize("pattern", ["RG", "GR", "GB", "BG"])
@pytest.mark.parametrize("bits", [8, 12])
def test_a_mosaic_of_one_colour_is_that_colour(pattern: str, bits: int) -> None:
    colour = {"R": 200, "G": 120, "B": 40}
    rows = {"RG": "RGGB", "GR": "GRBG", "GB": "GBRG", "BG": "BGGR"}[pattern]
    tile = np.array([[colour[rows[0]], colour[rows[1]]], [colour[rows[2]], colour[rows[3]]]])
    mosaic = np.tile(tile, (4, 4)) << (bits - 8)
    data = mosaic.astype(np.uint8 if bits == 8 else "<u2").tobytes()
    image = decode(f"Bayer{pattern}{bits}", 8, 8, data)
    inner = image[2:-2, 2:-2] >> (0 if bits == 8 else 8)
    assert (inner == [200, 120, 40]).all()


def test_bytes_after_the_image_are_ignored_and_missing_ones_named() -> None:
    assert decode("Mono8", 2, 2, b"\1\2\3\4rest").tolist() == [[1, 2], [3, 4]]
    for name in ("Mono8", "Mono12", "Mono12p", "RGB8", "BayerRG8"):
        with pytest.raises(ValueError, match=r"of"):
            decode(name, 100, 100, b"short")


@pytest.mark.parametrize("name", ["Mono8p", "Mono16p", "YUV422_8", "Mono9", "", "0x010c0006"])
def test_formats_not_known_are_refused(name: str) -> None:
    assert not understood(name)
    with pytest.raises(ValueError, match=r"not understood"):
        decode(name, 1, 1, b"0000")


@pytest.mark.parametrize("name", ["Mono8", "Mono10p", "BayerGB12", "RGB8", "BGR8Packed"])
def test_formats_known_are_told(name: str) -> None:
    assert understood(name)
