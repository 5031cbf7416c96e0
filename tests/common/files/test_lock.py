from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from common.files.lock import LockHeldError, lock_file, lock_folder

HOLD = """
import sys
from pathlib import Path
from common.files.lock import lock_file, lock_folder
path = Path(sys.argv[1])
lock = lock_folder(path) if path.is_dir() else lock_file(path, "the other one")
print("held", flush=True)
sys.stdin.read()
"""


def held_by_another(path: Path) -> subprocess.Popen[bytes]:
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert other.stdout is not None
    assert other.stdout.readline() == b"held\n"
    return other


def test_a_file_is_held_until_it_is_released(tmp_path: Path) -> None:
    lock = lock_file(tmp_path / "lock", "me")
    with pytest.raises(LockHeldError) as caught:
        lock_file(tmp_path / "lock", "somebody else")
    assert caught.value.holder == "me"
    lock.release()
    lock.release()
    lock_file(tmp_path / "lock", "a longer name").release()
    assert (tmp_path / "lock").read_text() == "a longer name"


def test_a_process_that_is_killed_lets_go(tmp_path: Path) -> None:
    for path in (tmp_path / "lock", tmp_path):
        with held_by_another(path) as other:
            with pytest.raises(LockHeldError):
                lock_folder(path) if path.is_dir() else lock_file(path, "me")
            other.kill()
        (lock_folder(path) if path.is_dir() else lock_file(path, "me")).release()


def test_a_folder_keeps_its_lock_when_it_is_renamed(tmp_path: Path) -> None:
    (tmp_path / "half").mkdir()
    lock = lock_folder(tmp_path / "half")
    (tmp_path / "half").rename(tmp_path / "whole")
    with pytest.raises(LockHeldError):
        lock_folder(tmp_path / "whole")
    lock.release()
    with pytest.raises(FileNotFoundError):
        lock_folder(tmp_path / "half")


def test_a_lock_file_is_for_all_users_and_never_a_link(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        lock_file(tmp_path / "lock", "me").release()
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "lock").stat().st_mode) == 0o666
    (tmp_path / "precious").write_text("kept")
    (tmp_path / "link").symlink_to(tmp_path / "precious")
    with pytest.raises(OSError, match="link"):
        lock_file(tmp_path / "link", "me")
    assert (tmp_path / "precious").read_text() == "kept"
