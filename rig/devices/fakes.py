"""The boxes that ``url = "fake:"`` means: each backend has its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from rig.acquisition.trigger.box import Edge, FireReport, ReportSource
from rig.acquisition.trigger.endpoint import PtyEndpoint
from rig.acquisition.trigger.fake.device import FakeBox, FakeSettings
from rig.acquisition.trigger.fake.esper import FakeEsper
from rig.acquisition.trigger.fake.line import FakeLine
from rig.acquisition.trigger.fake.serving import FakeServer


def serve_rigwright(serial_number: str) -> FakeServer:
    """A Rigwright box on a pseudo-terminal of this process."""
    box = FakeBox(time.monotonic_ns, FakeSettings(serial_number))
    return FakeServer(FakeLine(box, time.monotonic_ns), PtyEndpoint())


def serve_esper(serial_number: str) -> tuple[FakeServer, FakeEsper]:
    """An ESPER box on a pseudo-terminal of this process, and the box itself."""
    box = FakeEsper(time.monotonic_ns, serial_number)
    return FakeServer(box, PtyEndpoint()), box


class FakeEsperReports:
    """An ESPER box's reports with the edges that its fake really made.

    The box has no log, so its reports have no edges; cameras that exist only in the program must
    expose all the same, as real ones would.
    """

    def __init__(self, box: ReportSource, fake: FakeEsper) -> None:
        self._box = box
        self._fake = fake
        self._told = 0

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        """Hear every report, with its edges."""
        return self._box.subscribe(lambda report: listener(self._with_edges(report)))

    def _with_edges(self, report: FireReport) -> FireReport:
        made = self._fake.edges[self._told :]
        self._told += len(made)
        zero = min((edge.host_ns for edge in made), default=0)
        edges = tuple(
            Edge(1, edge.output, edge.rising, (edge.host_ns - zero) / 1e3, edge.host_ns, 0.0)
            for edge in made
        )
        return replace(report, edges=edges)
