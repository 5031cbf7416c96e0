"""A program that fires bursts on boxes: something to kill, or to freeze, from a test.

``python burst_host.py SEED URL...`` fires each box after a pause of its own and says ``firing``
when all do; then it waits.
"""

from __future__ import annotations

import random
import sys
import threading
import time

from rig.acquisition.trigger.box import ArmRequest, Pulse
from rig.acquisition.trigger.driver import BoxAddress, SerialTriggerBox

DEAD_MAN_S = 0.5
SHOTS = 200
INTERVAL_US = 100_000.0


def burst(number: int, url: str, pause_s: float) -> None:
    """Fire one box; it goes on for as long as somebody is there."""
    box = SerialTriggerBox(BoxAddress(url))
    box.open()
    request = ArmRequest(
        f"burst{number}",
        {1: Pulse(0.0, 20_000.0), 13: Pulse(2000.0, 200.0)},
        shots=SHOTS,
        interval_us=INTERVAL_US,
        dead_man_s=DEAD_MAN_S,
    )
    box.arm(request)
    time.sleep(pause_s)
    box.fire(f"burst{number}")


if __name__ == "__main__":
    draw = random.Random(int(sys.argv[1]))  # noqa: S311 - repeatable pauses
    threads = [
        threading.Thread(target=burst, args=(number, url, draw.uniform(0.0, 0.4)))
        for number, url in enumerate(sys.argv[2:])
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    sys.stdout.write("firing\n")
    sys.stdout.flush()
    time.sleep(3600.0)
