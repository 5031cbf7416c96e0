"""A serial line held by one owner: opened, locked, read and written, lost.

Any pyserial url will do: a device's path, ``socket://``, ``rfc2217://``, ``spy://``,
``loop://``. A write that returns proves nothing (on a closed socket it succeeds); only an answer
does.
"""

from __future__ import annotations

import hashlib
import os
import re
import select
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import serial

from common.errors import DeviceError
from common.files.lock import LockHeldError, lock_file

LINE_ERRORS = (serial.SerialException, OSError, TypeError)
"""What pyserial raises when a port goes: its own error, plain OSError from ``in_waiting``, and
TypeError where the handle was closed under it."""

_HOST_AND_PORT = re.compile(r"(?!COM)[\w.-]+:\d+", re.IGNORECASE)
"""A port of the network without the word ``socket://`` before it."""

_SLICE_S = 0.005
_WRITE_PATIENCE_S = 0.5


class LineLostError(Exception):
    """The port is gone: unplugged, closed by the other side, or it takes nothing any more."""


def bare_url(url: str) -> str:
    """The address without ``spy://`` and without options."""
    return re.sub(r"^spy://|\?.*$", "", url)


def is_device_path(url: str) -> bool:
    """Whether the address is a path of this computer."""
    return "://" not in bare_url(url)


class PortLock:
    """The lock on a port, by name.

    Raises :class:`~common.errors.DeviceError` ``device/trigger-busy`` that says who holds it.
    """

    def __init__(self, url: str) -> None:
        name = bare_url(url)
        # Two names of one port are one lock: the stable link and what it points to.
        real = os.path.realpath(name) if is_device_path(url) else name
        digest = hashlib.sha256(os.fsencode(real)).hexdigest()[:16]
        path = Path(tempfile.gettempdir()) / f"rigwright-trigger-{digest}.lock"
        program = Path(sys.argv[0]).name or "python"
        try:
            self._lock = lock_file(path, f"process {os.getpid()} ({program})\n")
        except LockHeldError as error:
            raise DeviceError(
                "trigger-busy",
                f"the trigger box at {name} is held by {error.holder or 'another program'}",
                "end that program, or let it do the work",
            ) from None

    def release(self) -> None:
        """Let go."""
        self._lock.release()


class SerialLine:
    """One open port. Used by one thread; :meth:`wake` from any.

    Raises :class:`~common.errors.DeviceError` ``device/trigger-gone`` or
    ``device/trigger-busy`` when it cannot be opened, :class:`LineLostError` afterwards.
    """

    def __init__(self, url: str, baud: int, wake_handle: int) -> None:
        self._wake_handle = wake_handle
        lock = PortLock(url)
        try:
            self._port = _open_port(url, baud)
        except BaseException:
            lock.release()
            raise
        self._lock = lock
        try:
            self._handle = self._port.fileno()
        except (OSError, AttributeError):
            self._handle = -1  # rfc2217:// and loop:// cannot be waited on
            self._port.timeout = _SLICE_S

    def close(self) -> None:
        """Let go of port and lock, whatever state they are in."""
        connection = getattr(self._port, "_socket", None)
        with suppress(*LINE_ERRORS):
            self._port.close()
        if connection is not None:
            # pyserial does not get to closing a socket whose other side has gone.
            connection.close()
        self._lock.release()

    def send(self, data: bytes) -> None:
        """Write all of it."""
        try:
            self._port.write(data)
        except LINE_ERRORS as error:
            raise LineLostError(str(error)) from error

    def receive(self, timeout_s: float, wakeable: bool) -> bytes:
        """What comes next; nothing after ``timeout_s``, or when woken."""
        try:
            if self._handle >= 0:
                return self._receive_ready(timeout_s, wakeable)
            return self._receive_sliced(timeout_s, wakeable)
        except LINE_ERRORS as error:
            raise LineLostError(str(error)) from error

    def _receive_ready(self, timeout_s: float, wakeable: bool) -> bytes:
        handles = [self._handle, self._wake_handle] if wakeable else [self._handle]
        ready, _, _ = select.select(handles, [], [], max(timeout_s, 0.0))
        if self._wake_handle in ready:
            os.read(self._wake_handle, 4096)
        return self._port.read(4096) if self._handle in ready else b""

    def _receive_sliced(self, timeout_s: float, wakeable: bool) -> bytes:
        deadline = time.monotonic() + timeout_s
        while True:
            data: bytes = self._port.read(1)
            if data or time.monotonic() >= deadline:
                return data
            if wakeable and select.select([self._wake_handle], [], [], 0.0)[0]:
                os.read(self._wake_handle, 4096)
                return b""


def _open_port(url: str, baud: int) -> serial.SerialBase:
    # rfc2217:// knows no time-out for writing and refuses to be given one.
    patience_s = None if bare_url(url).startswith("rfc2217://") else _WRITE_PATIENCE_S
    try:
        return serial.serial_for_url(
            url, baudrate=baud, timeout=0, write_timeout=patience_s, exclusive=True
        )
    except ValueError as error:
        raise DeviceError(
            "trigger-gone",
            f"{url!r} is no address of a port ({error})",
            "give a path such as /dev/serial/by-id/..., or socket://host:port",
        ) from error
    except LINE_ERRORS as error:
        if "exclusively lock" in str(error):
            raise DeviceError(
                "trigger-busy",
                f"the port {bare_url(url)} is held by another program",
                "end that program, or let it do the work",
            ) from error
        raise DeviceError(
            "trigger-gone",
            f"the port {bare_url(url)} cannot be opened ({error})",
            f"for a port of the network give socket://{url}"
            if _HOST_AND_PORT.fullmatch(url)
            else "plug the box in and check the port's name and your right to use it",
        ) from error
