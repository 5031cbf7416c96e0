"""A look at everything a capture needs, without firing anything."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from rig.acquisition.cameras.base import ArmSpec, CameraDevice, CameraSettings
from rig.acquisition.capture.camerathreads import CameraThread, outcomes
from rig.acquisition.capture.results import DeviceCheck, SelfTest
from rig.acquisition.session.storage import Disk
from rig.acquisition.station.spec import CameraPlan, Interlock, Station
from rig.acquisition.trigger.box import TriggerBox, TriggerState

MEGABYTE = 1e6
WORST_CLOCK_US = 500.0
"""A worse fit of the box's clock than this says that its line is disturbed."""


def self_test(
    station: Station,
    box: TriggerBox | None,
    threads: Sequence[CameraThread],
    problems: Mapping[str, str],
    folder: Path | None,
) -> SelfTest:
    """All checks. ``problems``: cameras that could not be opened, and why."""
    checks = [] if box is None else _box_checks(station, box)
    jobs = {thread.plan.name: thread.do(_Rehearsal(thread.plan, station)) for thread in threads}
    ready, late = outcomes(jobs, station.policy.ready_deadline_s)
    words = {**problems, **late}
    for camera in station.cameras:
        ok = camera.name in ready
        text = f"ready within {ready[camera.name]:.2f} s" if ok else words[camera.name]
        checks.append(DeviceCheck(f"camera {camera.name}", ok, text))
    if folder is not None:
        checks.append(_space(station, folder))
    return SelfTest(tuple(checks))


class _Rehearsal:
    """Arms a camera and disarms it; the answer is how long that took, in seconds."""

    def __init__(self, plan: CameraPlan, station: Station) -> None:
        self._settings: CameraSettings = plan.settings
        self._spec = ArmSpec("self-test", 1, station.policy.frame_deadline_s)

    def __call__(self, device: CameraDevice) -> float:
        began = time.monotonic()
        device.configure(self._settings)
        try:
            device.arm(self._spec)
        finally:
            device.disarm()
        return time.monotonic() - began


def _box_checks(station: Station, box: TriggerBox) -> list[DeviceCheck]:
    health = box.health()
    well = health.state is TriggerState.READY
    who = f"{health.identity or 'trigger box'}, {health.state.value}"
    text = who if well or not health.last_problem else f"{who}: {health.last_problem}"
    checks = [DeviceCheck("trigger box", well, text), _interlock(station, health.interlock_closed)]
    if box.capabilities.clock:
        residual = health.clock_residual_us
        fine = residual is not None and residual <= WORST_CLOCK_US
        said = "is not known yet" if residual is None else f"is known to {residual:.0f} us"
        checks.append(DeviceCheck("clock", fine, f"the box's clock {said}"))
    return checks


def _interlock(station: Station, closed: bool | None) -> DeviceCheck:
    required = station.trigger is not None and station.trigger.interlock is Interlock.REQUIRED
    words = {True: "closed", False: "open", None: "the box has none"}
    ok = closed is True or (closed is None and not required)
    return DeviceCheck("interlock", ok, words[closed])


def _space(station: Station, folder: Path) -> DeviceCheck:
    there = next(path for path in (folder, *folder.resolve().parents) if path.is_dir())
    free_mb = Disk().free_bytes(there) / MEGABYTE
    least = station.policy.min_free_mb
    return DeviceCheck(
        "free space", free_mb >= least, f"{free_mb:.0f} MB free, {least:.0f} MB wanted"
    )
