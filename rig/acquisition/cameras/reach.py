"""Folders that may not answer: a dead network share holds whoever looks at it, for ever."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TypeVar

from common.errors import DeviceError

T = TypeVar("T")
ANSWER_S = 0.5
"""A folder of a disk answers in milliseconds, one of a busy share in some hundred."""
REMOUNT_S = 0.7
"""How long a folder may be away: shares that are mounted again take some tenths of a second."""
OPEN_S = 20.0
"""A large tree on a slow share is looked through once when it is opened."""


def begun(job: Callable[[], T]) -> Future[T]:
    """The work in a thread of its own, which nobody waits for when it hangs."""
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(job())
        except BaseException as error:  # noqa: BLE001  it is raised again where it is awaited
            future.set_exception(error)

    threading.Thread(target=run, name="folder-look", daemon=True).start()
    return future


def answered(job: Callable[[], T], what: str, timeout_s: float = OPEN_S) -> T:
    """What ``job`` returns. Raises :class:`DeviceError` where ``what`` does not answer."""
    work = begun(job)
    try:
        return work.result(timeout_s)
    except TimeoutError:
        raise DeviceError(
            "camera-gone",
            f"{what} did not answer within {timeout_s:g} s",
            "see to its network share or disk, then try again",
        ) from None


def patiently(job: Callable[[], T]) -> T:
    """What ``job`` returns, tried again for ``REMOUNT_S`` while it raises OSError; then that."""
    until = time.monotonic() + REMOUNT_S
    while True:
        try:
            return job()
        except OSError:
            if time.monotonic() >= until:
                raise
            time.sleep(REMOUNT_S / 20.0)


class FolderReach:
    """Whether a folder is there, asked by one thread at most that may hang."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._asked: Future[bool] | None = None

    def problem(self) -> str:
        """Why the folder cannot be used; empty where it can. Returns within ``ANSWER_S``."""
        asked, patience_s = self._asked, 0.0
        if asked is None:
            asked, patience_s = begun(self._folder.is_dir), ANSWER_S
            self._asked = asked
        try:
            there = asked.result(patience_s)
        except TimeoutError:
            return "its folder does not answer: a dead network share or disk"
        except OSError as error:
            self._asked = None
            return f"its folder: {error.strerror}"
        self._asked = None
        return "" if there else "its folder is not there"
