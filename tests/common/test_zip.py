"""ZIP archives whose bytes follow from their content alone."""

from __future__ import annotations

import io
import zipfile

import pytest

from common.files.zip import zip_bytes

FILES = {"b/two.txt": b"two" * 400, "a.bin": bytes(range(256)), "empty": b""}


def test_an_archive_holds_its_files_in_their_order() -> None:
    with zipfile.ZipFile(io.BytesIO(zip_bytes(FILES))) as archive:
        assert archive.namelist() == list(FILES)
        assert {name: archive.read(name) for name in FILES} == FILES
        assert archive.testzip() is None
        assert archive.getinfo("b/two.txt").compress_size < 100


def test_the_same_files_give_the_same_bytes_at_any_time(monkeypatch: pytest.MonkeyPatch) -> None:
    before = zip_bytes(FILES)
    monkeypatch.setattr("time.time", lambda: 2e9)
    monkeypatch.setattr("time.localtime", lambda *_: (2033, 5, 18, 3, 33, 20, 2, 138, 0))
    assert zip_bytes(dict(FILES)) == before
