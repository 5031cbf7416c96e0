"""Serves a fake device on an endpoint, in a thread of its own."""

from __future__ import annotations

import os
import select
import threading
import time
from typing import Protocol

from common.closing import Closing
from rig.acquisition.trigger.endpoint import Endpoint

_IDLE_S = 0.5


class Device(Protocol):
    """A device's end of the line."""

    def receive(self, data: bytes) -> None:
        """Bytes have come."""
        ...

    def take(self) -> bytes:
        """What it has to say now."""
        ...

    def next_due_ns(self) -> int | None:
        """When it may have something to say without being asked (``time.monotonic_ns``)."""
        ...


class FakeServer(Closing):
    """Carries bytes between an endpoint and a device until :meth:`close`."""

    def __init__(self, device: Device, endpoint: Endpoint) -> None:
        self.device = device
        self._endpoint = endpoint
        self._lock = threading.Lock()
        self._wake_read, self._wake_write = os.pipe()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="fake trigger box", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """What a driver opens."""
        return self._endpoint.url

    def unplug(self) -> None:
        """The cable is pulled; the box keeps its power and goes on."""
        with self._lock:
            self._endpoint.unplug()
        self.wake()

    def replug(self) -> None:
        """The cable is back."""
        with self._lock:
            self._endpoint.replug()
        self.wake()

    def wake(self) -> None:
        """Look at the device again: something was done to it from outside the line."""
        os.write(self._wake_write, b"w")

    def close(self) -> None:
        """Stop serving. Closing twice changes nothing."""
        if self._closing:
            return
        self._closing = True
        self.wake()
        self._thread.join()
        self._endpoint.unplug()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _run(self) -> None:
        while not self._closing:
            with self._lock:
                handles = self._endpoint.handles()
            try:
                ready, _, _ = select.select([*handles, self._wake_read], [], [], self._patience_s())
            except (OSError, ValueError):
                continue  # unplugged between asking for the handles and waiting on them
            if self._wake_read in ready:
                os.read(self._wake_read, 4096)
            self._serve()

    def _serve(self) -> None:
        with self._lock:
            if self._endpoint.handles():
                data = self._endpoint.read()
                if data:
                    self.device.receive(data)
            said = self.device.take()
            if said:
                self._endpoint.write(said)

    def _patience_s(self) -> float:
        due = self.device.next_due_ns()
        if due is None:
            return _IDLE_S
        return min(max(due - time.monotonic_ns(), 0) / 1e9, _IDLE_S)
