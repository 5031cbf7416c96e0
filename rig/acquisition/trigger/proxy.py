"""A fault proxy: stands between a driver and any device and does to the line what cables do.

It offers a pseudo-terminal or a TCP port and opens the device by url. Faults come by seeded
rates, or at a set byte or line. What it did is counted, so that a test can say that it did
something.
"""

from __future__ import annotations

import heapq
import os
import random
import select
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count

import serial

from common.closing import Closing
from rig.acquisition.trigger.endpoint import Endpoint
from rig.acquisition.trigger.faultscript import FaultRates, Incident, ProxyScript, Way
from rig.acquisition.trigger.serialline import LINE_ERRORS

_PARTIAL_S = 0.25
"""A box on a busy computer sends a line in pieces; incidents are of whole lines."""

_IDLE_S = 0.5
_NOISE_BYTES = 60


@dataclass
class _Direction:
    """One way through the proxy."""

    way: Way
    rates: FaultRates
    partial: bytearray = field(default_factory=bytearray)
    partial_since: float = 0.0
    lines: int = 0
    passed: int = 0
    busy_until: float = 0.0
    waiting: list[tuple[float, int, bytes]] = field(default_factory=list)


class FaultProxy(Closing):
    """A running proxy; end it with :meth:`close`.

    ``reset`` is how the device is reset, for incidents that do that. ``done`` counts faults.
    """

    def __init__(
        self,
        device_url: str,
        endpoint: Endpoint,
        script: ProxyScript,
        reset: Callable[[], None] | None = None,
    ) -> None:
        self.done: Counter[str] = Counter()
        self._script = script
        self._endpoint = endpoint
        self._reset = reset
        self._random = random.Random(script.seed)  # noqa: S311 - chance of faults
        self._order = count()
        self._ways: dict[Way, _Direction] = {
            "to_box": _Direction("to_box", script.to_box),
            "to_host": _Direction("to_host", script.to_host),
        }
        self._incidents = list(script.incidents)
        self._replug_at: float | None = None
        self._device = serial.serial_for_url(device_url, timeout=0)
        self._wake_read, self._wake_write = os.pipe()
        self._commands: list[Callable[[], None]] = []
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="fault proxy", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """What a driver opens."""
        return self._endpoint.url

    def unplug(self, for_s: float = -1.0) -> None:
        """Pull the cable on the host's side; back after ``for_s``, never when negative."""
        self._tell(lambda: self._unplug(for_s))

    def replug(self) -> None:
        """Put it back."""
        self._tell(self._endpoint.replug)

    def add(self, incident: Incident) -> None:
        """One more thing that will happen, once."""
        self._incidents.append(incident)

    def passed(self, way: Way) -> int:
        """How many bytes have gone that way so far."""
        return self._ways[way].passed

    def close(self) -> None:
        """Stop. Closing twice changes nothing."""
        if self._closing:
            return
        self._closing = True
        os.write(self._wake_write, b"w")
        self._thread.join()
        self._endpoint.unplug()
        self._device.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _tell(self, command: Callable[[], None]) -> None:
        self._commands.append(command)
        os.write(self._wake_write, b"w")

    # -- the loop ----------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._closing:
            handles = [*self._endpoint.handles(), self._device.fileno(), self._wake_read]
            ready, _, _ = select.select(handles, [], [], self._patience_s())
            if self._wake_read in ready:
                os.read(self._wake_read, 4096)
            while self._commands:
                self._commands.pop(0)()
            if not self._move(ready):
                return
            self._flush_partial()
            self._deliver()
            if self._replug_at is not None and time.monotonic() >= self._replug_at:
                self._replug_at = None
                self._endpoint.replug()

    def _move(self, ready: list[int]) -> bool:
        """Take in what has come; False when the device itself is gone."""
        if self._endpoint.handles():
            self._take_in(self._ways["to_box"], self._endpoint.read())
        if self._device.fileno() in ready:
            try:
                self._take_in(self._ways["to_host"], self._device.read(4096))
            except LINE_ERRORS:
                self.done["device-gone"] += 1
                self._endpoint.unplug()
                return False
        return True

    def _patience_s(self) -> float:
        moments = [way.waiting[0][0] for way in self._ways.values() if way.waiting]
        moments += [way.partial_since + _PARTIAL_S for way in self._ways.values() if way.partial]
        if self._replug_at is not None:
            moments.append(self._replug_at)
        left = min(moments, default=time.monotonic() + _IDLE_S) - time.monotonic()
        return min(max(left, 0.0), _IDLE_S)

    # -- faults ------------------------------------------------------------------------------

    def _take_in(self, way: _Direction, data: bytes) -> None:
        if data and way.rates.echo and way.way == "to_box":
            self._queue(self._ways["to_host"], data, 0.0)
        while data:
            head, mark, data = data.partition(b"\n")
            if not way.partial:
                way.partial_since = time.monotonic()
            way.partial += head + mark
            if mark:
                unit = bytes(way.partial)
                way.partial.clear()
                self._suffer(way, unit)

    def _flush_partial(self) -> None:
        for way in self._ways.values():
            if way.partial and time.monotonic() - way.partial_since > _PARTIAL_S:
                self._queue(way, bytes(way.partial), 0.0)
                way.partial.clear()

    def _suffer(self, way: _Direction, unit: bytes) -> None:
        way.lines += 1
        unit = self._incident(way, unit)
        rates = way.rates
        delay = self._random.random() * rates.latency_s
        for fault in ("drop", "corrupt", "truncate", "duplicate", "noise"):
            if unit and self._strikes(rates, fault):
                unit = self._damage(fault, unit)
        if self._strikes(rates, "delay"):
            delay += self._random.random() * rates.delay_s
        overtaken = self._strikes(rates, "reorder")
        if overtaken:
            delay += self._random.random() * rates.delay_s
        if len(unit) > 2 and self._strikes(rates, "split"):
            cut = self._random.randrange(1, len(unit))
            self._queue(way, unit[:cut], delay, overtaken)
            unit, delay = unit[cut:], delay + 0.01
        self._queue(way, unit, delay, overtaken)

    def _strikes(self, rates: FaultRates, fault: str) -> bool:
        rate: float = getattr(rates, fault)
        if rate == 0.0 or self._random.random() >= rate:
            return False
        self.done[fault] += 1
        return True

    def _damage(self, fault: str, unit: bytes) -> bytes:
        if fault == "drop":
            return b""
        if fault == "duplicate":
            return unit * 2
        if fault == "truncate":
            return unit[: self._random.randrange(len(unit))]
        if fault == "noise":
            return self._random.randbytes(_NOISE_BYTES) + unit
        at = self._random.randrange(len(unit))
        changed = unit[at] ^ (1 << self._random.randrange(8))
        return unit[:at] + bytes([changed]) + unit[at + 1 :]

    def _incident(self, way: _Direction, unit: bytes) -> bytes:
        before, way.passed = way.passed, way.passed + len(unit)
        for incident in list(self._incidents):
            if not incident.strikes(way.way, way.lines, before, unit):
                continue
            self._incidents.remove(incident)
            self.done[incident.do] += 1
            kept = unit[: incident.at_byte - before] if incident.at_byte is not None else b""
            if incident.do == "noise":
                unit = self._random.randbytes(4096) + unit
            elif incident.do == "drop":
                unit = kept
            elif incident.do == "unplug":
                self._queue(way, kept, 0.0)
                self._deliver()
                self._unplug(incident.for_s)
                unit = b""
            elif self._reset is not None:
                self._reset()
        return unit

    def _unplug(self, for_s: float) -> None:
        for way in self._ways.values():
            way.waiting.clear()
            way.partial.clear()
        self._endpoint.unplug()
        self._replug_at = time.monotonic() + for_s if for_s >= 0.0 else None

    def _queue(self, way: _Direction, data: bytes, delay: float, overtaken: bool = False) -> None:
        if not data:
            return
        due = time.monotonic() + delay
        if way.rates.merge_s:
            due = (due // way.rates.merge_s + 1.0) * way.rates.merge_s
        if not overtaken:
            due = way.busy_until = max(due, way.busy_until)
        heapq.heappush(way.waiting, (due, next(self._order), data))

    def _deliver(self) -> None:
        now = time.monotonic()
        for way in self._ways.values():
            out = b""
            while way.waiting and way.waiting[0][0] <= now:
                out += heapq.heappop(way.waiting)[2]
            if out and way.way == "to_box":
                self._device.write(out)
            elif out:
                self._endpoint.write(out)
