"""The fake boxes as a program, until it is interrupted."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from common.closing import Closing
from common.errors import InputError
from rig.acquisition.trigger.endpoint import Endpoint, PtyEndpoint, TcpEndpoint
from rig.acquisition.trigger.fake.device import FakeBox, FakeSettings
from rig.acquisition.trigger.fake.esper import FakeEsper
from rig.acquisition.trigger.fake.faults import FakeFaults, FaultyLine
from rig.acquisition.trigger.fake.line import FakeLine
from rig.acquisition.trigger.fake.serving import FakeServer


@dataclass(frozen=True)
class FakeTrigger(Closing):
    """A fake box being served: the box, to look at its edges, and the server, to unplug it."""

    box: FakeBox
    server: FakeServer

    @property
    def url(self) -> str:
        """What a driver opens."""
        return self.server.url

    def close(self) -> None:
        """Stop serving it."""
        self.server.close()


def start_fake(
    settings: FakeSettings | None = None,
    faults: FakeFaults | None = None,
    *,
    link: Path | None = None,
    port: int | None = None,
    reset_on_open: bool = False,
) -> FakeTrigger:
    """Serve a fake box from this process: on a pseudo-terminal, or on a TCP port if one is given.

    ``port`` 0 takes any free one; ``link`` is a stable symbolic link to the terminal.
    ``reset_on_open`` (TCP only) resets the box at each connection, as the DTR line of an Uno
    does.
    """
    settings = settings or FakeSettings()
    box = FakeBox(time.monotonic_ns, settings)
    line = FakeLine(box, time.monotonic_ns)
    device = FaultyLine(line, faults, settings.seed, time.monotonic_ns) if faults else line
    endpoint = _endpoint(link, port, box.reset if reset_on_open else None)
    return FakeTrigger(box, FakeServer(device, endpoint))


def _endpoint(
    link: Path | None, port: int | None, on_connect: Callable[[], None] | None
) -> Endpoint:
    if port is None:
        return PtyEndpoint(link)
    if link is not None:
        raise InputError(
            "fake-link", "a TCP port has no symbolic link", "give either a link or a port"
        )
    return TcpEndpoint(port, on_connect)


@dataclass(frozen=True)
class FakeOptions:
    """What can be asked of the fake program; all units as named, ``faults`` as text.

    ``link`` or ``port`` say where it is offered; with neither it is a bare pseudo-terminal.
    ``esper`` serves an ESPER TriggerBox instead; of the rest it knows only ``serial_number``.
    """

    serial_number: str = "fake"
    link: Path | None = None
    port: int | None = None
    seed: int = 0
    faults: str = ""
    drift_ppm: float = 0.0
    start_ticks: int = 0
    jitter_us: float = 0.0
    identity: str = ""
    reset_on_open: bool = False
    boot_s: float = 0.0
    esper: bool = False
    stop: threading.Event = field(default_factory=threading.Event)


def run_fake(options: FakeOptions, say: Callable[[str], None] = print) -> None:
    """Serve a fake trigger box until ``options.stop`` is set or Ctrl-C; says where it is."""
    with _served(options) as server:
        say(f"a fake trigger box answers at {server.url} (Ctrl-C ends it)")
        with contextlib.suppress(KeyboardInterrupt):
            options.stop.wait()


def _served(options: FakeOptions) -> FakeServer:
    if options.esper:
        endpoint = _endpoint(options.link, options.port, None)
        return FakeServer(FakeEsper(time.monotonic_ns, options.serial_number), endpoint)
    settings = FakeSettings(
        serial_number=options.serial_number,
        drift_ppm=options.drift_ppm,
        start_ticks=options.start_ticks,
        jitter_ticks=round(options.jitter_us * 2.0),
        seed=options.seed,
        identity=options.identity,
        boot_s=options.boot_s,
    )
    faults = FakeFaults.parse(options.faults) if options.faults else None
    fake = start_fake(
        settings,
        faults,
        link=options.link,
        port=options.port,
        reset_on_open=options.reset_on_open,
    )
    return fake.server
