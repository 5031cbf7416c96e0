"""Unknown words are answered with the nearest known one."""

from __future__ import annotations

import pytest

from common.words import counted, did_you_mean, of_limits, percent_cut


@pytest.mark.parametrize(
    ("word", "otherwise", "remedy"),
    [
        ("lenss", None, "did you mean lens?"),
        ("xyz", None, "choose one of lens, mount"),
        ("xyz", "remove it", "remove it"),
        ("mounts", "remove it", "did you mean mount?"),
    ],
)
def test_the_nearest_word_is_offered(word: str, otherwise: str | None, remedy: str) -> None:
    assert did_you_mean(word, ["lens", "mount"], otherwise) == remedy


@pytest.mark.parametrize(
    ("share", "told"),
    [
        (1.0, "100.00 %"),
        (0.99999, "99.99 %"),
        (0.99975, "99.97 %"),
        (0.29, "29.00 %"),
        (0.0, "0.00 %"),
    ],
)
def test_a_share_is_cut_and_never_rounded_up(share: float, told: str) -> None:
    assert percent_cut(share) == told


def test_every_share_of_whole_percents_is_told_as_it_is() -> None:
    assert [percent_cut(k / 100.0, 0) for k in range(101)] == [f"{k} %" for k in range(101)]


def test_one_is_counted_without_an_s() -> None:
    assert [counted(k, "capture") for k in (0, 1, 2)] == ["0 captures", "1 capture", "2 captures"]


def test_broken_limits_are_told_by_their_kind() -> None:
    names = ["scale/cam01", "coverage", "scale/cam03", "near/cam01-cam02"]
    assert of_limits(names) == "scale (cam01, cam03); coverage; near (cam01-cam02)"
    many = [f"scale/cam{k}" for k in range(9)]
    assert of_limits(many, 2) == "scale (cam0, cam1, 7 more)"
    assert of_limits(many, 9).endswith("cam8)") and of_limits([]) == ""
