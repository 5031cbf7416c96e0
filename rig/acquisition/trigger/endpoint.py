"""The far end of a serial line, offered to others: a pseudo-terminal or a TCP port.

The fake boxes and the fault proxy stand behind one of these. Both can be unplugged and plugged
in again under the same name, as an adapter on a stable path can.
"""

from __future__ import annotations

import errno
import os
import re
import socket
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from common.errors import InputError

_CHUNK = 4096


class Endpoint(Protocol):
    """Bytes to and from whoever opens :attr:`url`. Used by one thread; nothing blocks."""

    @property
    def url(self) -> str:
        """What a driver opens."""
        ...

    def handles(self) -> list[int]:
        """File descriptors to wait on for reading."""
        ...

    def read(self) -> bytes:
        """What has come; nothing when nothing has."""
        ...

    def write(self, data: bytes) -> None:
        """Send; what the other side does not take is lost, as on a serial line."""
        ...

    def unplug(self) -> None:
        """Vanish. Unplugging twice changes nothing."""
        ...

    def replug(self) -> None:
        """Come back under the same url."""
        ...


class PtyEndpoint:
    """A pseudo-terminal; ``link`` is a stable symbolic link to it.

    Without a link it may come back from :meth:`replug` under another name.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self._master = self._slave = -1
        self._path = ""
        self.replug()

    @property
    def url(self) -> str:
        """The link if there is one, else the terminal's own path."""
        return str(self._link) if self._link else self._path

    def handles(self) -> list[int]:
        """The master side."""
        return [self._master] if self._master >= 0 else []

    def read(self) -> bytes:
        """What the host has written."""
        with suppress(BlockingIOError):
            return os.read(self._master, _CHUNK)
        return b""

    def write(self, data: bytes) -> None:
        """Lost when the host reads so little that the terminal is full."""
        if self._master >= 0:
            with suppress(BlockingIOError):
                os.write(self._master, data)

    def unplug(self) -> None:
        """The terminal hangs up and its link vanishes."""
        if self._master < 0:
            return
        if self._link and _leads_to(self._link) == self._path:
            self._link.unlink(missing_ok=True)
        self._hang_up()

    def replug(self) -> None:
        """A new terminal, under the old link."""
        if self._master >= 0:
            return
        # The slave side stays open here: without any holder the master would report EIO.
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._path = os.ttyname(self._slave)
        if self._link:
            try:
                self._place_link(self._link)
            except BaseException:
                self._hang_up()
                raise

    def _hang_up(self) -> None:
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    def _place_link(self, link: Path) -> None:
        former = _leads_to(link)
        try:
            # A box that was killed left its link; any other is somebody's.
            if former is not None and _is_terminal(former, self._path):
                link.unlink(missing_ok=True)
            link.symlink_to(self._path)
        except FileExistsError as error:
            raise InputError(
                "fake-link",
                f"{link} is there already, and is no link of a fake box",
                "name a path that is free",
            ) from error
        except OSError as error:
            raise InputError(
                "fake-link",
                f"the link {link} cannot be made ({(error.strerror or 'unwritable').lower()})",
                "name another path, in a folder that is there",
            ) from error


def _leads_to(link: Path) -> str | None:
    """The text of a symbolic link; None for what is none."""
    try:
        return str(link.readlink())
    except OSError:
        return None


def _is_terminal(path: str, like: str) -> bool:
    """Whether ``path`` names a pseudo-terminal, gone or not, as ``like`` does."""
    before_number = re.escape(like.rstrip("0123456789"))
    return re.fullmatch(rf"{before_number}\d+", path) is not None


class TcpEndpoint:
    """A TCP port of this computer, for ``socket://``; one client at a time, as on a cable."""

    def __init__(self, port: int = 0, on_connect: Callable[[], None] | None = None) -> None:
        self._port = port
        self._on_connect = on_connect
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None
        self.replug()

    @property
    def url(self) -> str:
        """``socket://127.0.0.1:port``."""
        return f"socket://127.0.0.1:{self._port}"

    def handles(self) -> list[int]:
        """The listener and the client."""
        return [s.fileno() for s in (self._listener, self._client) if s is not None]

    def read(self) -> bytes:
        """What the client has sent; accepts one if one is waiting."""
        data = self._receive()
        self._accept()
        return data

    def _receive(self) -> bytes:
        if self._client is None:
            return b""
        try:
            data = self._client.recv(_CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._client.close()
            self._client = None
        return data

    def _accept(self) -> None:
        if self._listener is None:
            return
        try:
            client, _ = self._listener.accept()
        except BlockingIOError:
            return
        if self._client is not None:
            client.close()
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
        if self._on_connect is not None:
            self._on_connect()

    def write(self, data: bytes) -> None:
        """Lost when nobody is connected."""
        if self._client is not None:
            with suppress(OSError):
                self._client.send(data)

    def unplug(self) -> None:
        """Client and listener are closed."""
        for each in (self._client, self._listener):
            if each is not None:
                each.close()
        self._client = self._listener = None

    def replug(self) -> None:
        """Listen again on the same port."""
        if self._listener is not None:
            return
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", self._port))
        except OSError as error:
            listener.close()
            why = "is taken" if error.errno == errno.EADDRINUSE else f"cannot be used ({error})"
            raise InputError(
                "fake-port", f"port {self._port} {why}", "give another one, or 0 for any"
            ) from error
        listener.listen(1)
        listener.setblocking(False)
        self._port = listener.getsockname()[1]
        self._listener = listener
