"""One owner per device, across processes."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from memoryrig import memory_station

from common.errors import ConflictError, InputError
from rig.acquisition.station.locks import DeviceLocks, device_names
from rig.acquisition.station.spec import TriggerPlan

REPO = Path(__file__).resolve().parents[4]
HOLDER = """
import sys, time
from pathlib import Path
from rig.acquisition.station.locks import DeviceLocks
with DeviceLocks(["trigger box /dev/ttyX"], Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_another_process_is_refused_and_told_who_holds_it(tmp_path: Path) -> None:
    other = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, cwd=REPO
    )
    try:
        assert other.stdout is not None and other.stdout.readline() == b"held\n"
        with pytest.raises(ConflictError) as error:
            DeviceLocks(["camera a", "trigger box /dev/ttyX"], tmp_path)
        assert error.value.code == "conflict/device-busy"
        assert f"trigger box /dev/ttyX is in use by process {other.pid} on " in str(error.value)
        # What was taken before the refusal has been let go.
        DeviceLocks(["camera a"], tmp_path).close()
    finally:
        other.kill()
        other.communicate()
    # A process that was killed holds nothing.
    with DeviceLocks(["trigger box /dev/ttyX"], tmp_path):
        pass


def test_locks_are_let_go_and_taken_again(tmp_path: Path) -> None:
    for _ in range(2):
        with DeviceLocks(["a", "b"], tmp_path), pytest.raises(ConflictError):
            DeviceLocks(["b"], tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_a_holder_that_has_not_yet_said_its_name(tmp_path: Path) -> None:
    locks = DeviceLocks(["a"], tmp_path)
    next(tmp_path.iterdir()).write_text("")
    with pytest.raises(ConflictError, match="in use by another process"):
        DeviceLocks(["a"], tmp_path)
    locks.close()


def test_a_planted_link_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    folder = tmp_path / "locks"
    DeviceLocks(["a"], folder).close()
    lock = next(folder.iterdir())
    lock.unlink()
    lock.symlink_to(victim)
    with pytest.raises(InputError, match="cannot lock the a"):
        DeviceLocks(["a"], folder)
    assert victim.read_text() == "precious"


def test_two_names_of_one_port_are_one_lock(tmp_path: Path) -> None:
    port, link = tmp_path / "tty", tmp_path / "by-id"
    port.touch()
    link.symlink_to(port)
    stations = [
        replace(memory_station(), trigger=TriggerPlan("rigwright", str(path)))
        for path in (port, link)
    ]
    assert device_names(stations[0])[0] == device_names(stations[1])[0]
    assert os.path.realpath(link) in device_names(stations[1])[0]


def test_what_exists_in_one_process_only_is_not_locked() -> None:
    cameras = tuple(replace(c, backend="simulated") for c in memory_station().cameras)
    station = memory_station(cameras=cameras, trigger=TriggerPlan("rigwright", "fake:"))
    assert device_names(station) == []
