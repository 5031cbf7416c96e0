"""Unknown words are answered with the nearest known one."""

from __future__ import annotations

import pytest

from common.words import did_you_mean


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
