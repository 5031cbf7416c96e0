"""How the firmware's sources hang together."""

from __future__ import annotations

import re
from graphlib import TopologicalSorter
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[3] / "rig/firmware"


def test_no_two_modules_of_the_firmware_need_each_other() -> None:
    """A module is its `.c` and its `.h`; raises CycleError, which names the circle."""
    needs: dict[str, set[str]] = {}
    for path in [*SOURCES.glob("*.[ch]"), *SOURCES.glob("*.S")]:
        included = set(re.findall(r'#include "(\w+)\.h"', path.read_text()))
        needs.setdefault(path.stem, set()).update(included - {path.stem})
    order = list(TopologicalSorter(needs).static_order())
    assert set(order) >= {"main", "box", "events", "interlock", "player"}
