"""Writes that must come about: how a job ended, however long the disk is full."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable
from typing import TypeVar

from sqlalchemy.exc import SQLAlchemyError

from service import logs

T = TypeVar("T")
RETRY_S = 1.0
FULL = (errno.ENOSPC, errno.EDQUOT)


def write_at_last(write: Callable[[], T], give_up: threading.Event) -> T:
    """What ``write`` gives, tried again and again while the store or its disk refuses it.

    Raises what it raised last once ``give_up`` is set: then the next start finds the job and
    marks it.
    """
    told = False
    while True:
        try:
            return write()
        except (SQLAlchemyError, OSError) as error:
            if isinstance(error, OSError) and error.errno not in FULL:
                raise
            if not told:
                logs.log.exception("how a job ended cannot be written; it is tried again")
                told = True
            if give_up.wait(RETRY_S):
                raise
