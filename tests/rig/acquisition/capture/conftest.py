"""What tests of captures share: a rig of cameras that are seen through folders."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from tethered import Tethered, station

from rig.devices.station import open_station


@pytest.fixture
def tethered(tmp_path: Path) -> Iterator[Tethered]:
    root = tmp_path / "tether"
    with open_station(station(root), locks=tmp_path / "locks") as rig:
        session = rig.new_session(tmp_path / "session")
        with session:
            yield Tethered(rig, session, root)
