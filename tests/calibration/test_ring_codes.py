"""Codes stay themselves however they are turned, and misread ones are noticed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.targets.ringcodes import RingCodeFamily, canonical, mirrored, rotations
from common.errors import InputError

FAMILIES = {bits: RingCodeFamily(bits) for bits in (12, 14)}
codes = st.sampled_from([12, 14]).flatmap(
    lambda bits: st.tuples(
        st.just(bits), st.integers(1, len(FAMILIES[bits].words)), st.integers(0, bits - 1)
    )
)


@given(codes)
def test_a_code_is_read_however_the_target_is_turned(code: tuple[int, int, int]) -> None:
    bits, number, turn = code
    family = FAMILIES[bits]
    assert family.number(rotations(family.word(number), bits)[turn]) == number


@given(codes)
def test_a_bit_misread_is_never_another_code(code: tuple[int, int, int]) -> None:
    bits, number, bit = code
    family = FAMILIES[bits]
    assert family.number(family.word(number) ^ (1 << bit)) is None


@given(codes)
def test_a_mirrored_code_is_noticed_or_looks_the_same(code: tuple[int, int, int]) -> None:
    bits, number, turn = code
    family = FAMILIES[bits]
    word = rotations(mirrored(family.word(number), bits), bits)[turn]
    if canonical(word, bits) == canonical(family.word(number), bits):
        assert family.mirror_number(word) is None
    else:
        assert family.number(word) is None
        assert family.mirror_number(word) == number


def test_families_are_large_enough_for_a_rig() -> None:
    assert len(FAMILIES[12].words) >= 40
    assert len(FAMILIES[14].words) >= 100
    assert len(RingCodeFamily(14, distance=1).words) > len(FAMILIES[14].words)


def test_numbers_that_do_not_exist_are_refused() -> None:
    with pytest.raises(InputError, match="no ring target 0"):
        FAMILIES[12].word(0)
    with pytest.raises(InputError, match="no ring codes of 13 bits"):
        RingCodeFamily(13)
