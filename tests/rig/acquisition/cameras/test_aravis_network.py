"""Several of Aravis's fake cameras, each at an address of its own on the loopback device.

Not marked as needing Aravis alone: giving addresses also needs a right that CI may not have.
"""

from __future__ import annotations

import contextlib
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import pytest
from camera_rigs import FAKE_GV, FakeGigE

from rig.acquisition.cameras.aravis import AravisBackend
from rig.acquisition.cameras.base import ArmSpec, FrameStatus


@contextlib.contextmanager
def loopback_aliases(addresses: Sequence[str]) -> Iterator[None]:
    added = []
    try:
        for address in addresses:
            order = ["ip", "addr", "add", f"{address}/8", "dev", "lo"]
            try:
                done = subprocess.run(order, capture_output=True, text=True, check=False)
            except FileNotFoundError:
                pytest.skip("no 'ip' command to give the loopback device more addresses")
            if done.returncode:
                pytest.skip(f"no right to give the loopback device more addresses: {done.stderr}")
            added.append(address)
        yield
    finally:
        for address in added:
            subprocess.run(["ip", "addr", "del", f"{address}/8", "dev", "lo"], check=True)


@pytest.mark.skipif(shutil.which(FAKE_GV) is None, reason=f"{FAKE_GV} is not installed")
def test_three_cameras_are_told_apart_by_serial_number() -> None:
    places = {"RW21": "127.0.0.21", "RW22": "127.0.0.22", "RW23": "127.0.0.23"}
    with loopback_aliases(list(places.values())), contextlib.ExitStack() as stack:
        for serial, address in places.items():
            stack.callback(FakeGigE(serial, address).stop)
        backend = AravisBackend(trigger="software")
        stack.callback(backend.close)
        found = {info.id: info.address for info in backend.discover()}
        assert found == places
        with ThreadPoolExecutor() as pool:
            cameras = list(pool.map(backend.open, reversed(places)))
        for camera in cameras:
            camera.arm(ArmSpec("all", 1, 1.0))
        for camera in cameras:
            camera.software_trigger()
        for camera, serial in zip(cameras, reversed(places), strict=True):
            (frame,) = camera.wait_frames(1, 1.0)
            assert frame.camera_id == camera.info.id == serial
            assert frame.status is FrameStatus.OK
