"""Open rigs of memory, each with a session, and their taking down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from memoryrig import BoxScript, CameraScript, MemoryBox, MemoryDevices, line_fit, memory_station

from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.folder import Session
from rig.acquisition.session.storage import Disk
from rig.acquisition.station.spec import Station


@dataclass
class Bench:
    """An open rig of memory, what it is made of, and a session."""

    rig: Rig
    devices: MemoryDevices
    session: Session

    @property
    def box(self) -> MemoryBox:
        return self.devices.box


class BenchMaker:
    """Makes benches and takes them down again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made: list[Bench] = []
        self.count = 0

    def __call__(
        self,
        station: Station | None = None,
        scripts: Mapping[str, CameraScript] | None = None,
        box: BoxScript | None = None,
        disk: Disk | None = None,
    ) -> Bench:
        devices = MemoryDevices(scripts or {}, MemoryBox(box or BoxScript()))
        station = memory_station() if station is None else station
        rig = Rig(station, devices, locks=self.folder / "locks", fit=line_fit)
        self.count += 1
        place = self.folder / f"session{self.count}"
        bench = Bench(rig, devices, rig.new_session(place, "me", disk=disk))
        self.made.append(bench)
        return bench

    def close(self) -> None:
        for bench in self.made:
            bench.session.close()
            bench.rig.close()
