"""Frames of one of Aravis's fake GigE Vision cameras, open for all tests here."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from camera_rigs import CameraRig, aravis_rig

from common.errors import DeviceError
from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraDevice,
    CameraSettings,
    FrameStatus,
    TimestampKind,
)

pytestmark = pytest.mark.needs_aravis

FAKE_PERIOD_S = 0.04
"""The fake looks for triggers 25 times a second."""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CameraRig]:
    """One fake camera and its backend, triggered by software."""
    world = aravis_rig(tmp_path_factory.mktemp("aravis"), "RW10")
    yield world
    world.close()


@pytest.fixture(scope="module")
def shared(world: CameraRig) -> CameraDevice:
    """That camera, open."""
    return world.backend.open("RW10")


def test_the_cameras_clock_stamps_each_frame_and_is_bracketed(shared: CameraDevice) -> None:
    assert shared.capabilities.timestamps is TimestampKind.DEVICE
    shared.arm(ArmSpec("clock", 3, 1.0))
    for k in range(1, 4):
        shared.software_trigger()
        shared.wait_frames(k, 1.0)
    frames, samples = shared.wait_frames(3, 0.0), shared.clock_samples(3)
    stamps = [frame.device_ns for frame in frames]
    assert stamps == sorted(stamps)
    assert [sample.device_ns for sample in samples] == stamps
    for sample, frame in zip(samples, frames, strict=True):
        assert sample.host_after_ns == frame.arrived_host_ns
        assert (sample.host_after_ns - sample.host_before_ns) / 1e9 < 5 * FAKE_PERIOD_S
    # The fake's clock is the machine's: its offset from the monotonic one is the same for all.
    offsets = [(s.device_ns - s.host_before_ns, s.device_ns - s.host_after_ns) for s in samples]
    assert min(high for high, _ in offsets) > max(low for _, low in offsets)


def test_a_frame_after_its_deadline_is_late(shared: CameraDevice) -> None:
    # The fake looks for commands once a period: a tenth of a millisecond is hardly ever enough.
    shared.arm(ArmSpec("late", 3, 1e-4))
    for k in range(1, 4):
        shared.software_trigger()
        frames = shared.wait_frames(k, 1.0)
    assert FrameStatus.LATE in {frame.status for frame in frames}
    assert shared.health().counters["late_frames"] >= 1


def test_a_camera_held_here_is_not_opened_twice(world: CameraRig, shared: CameraDevice) -> None:
    with pytest.raises(DeviceError) as caught:
        world.backend.open("RW10")
    assert caught.value.code == "device/camera-busy"
    assert [info.id for info in world.backend.discover()] == ["RW10"]
    assert shared.health().connected


def test_bits_beyond_eight_and_colour_come_through(shared: CameraDevice) -> None:
    for name, shape, kind in (
        ("Mono16", (512, 512), "uint16"),
        ("RGB8", (512, 512, 3), "uint8"),
        ("BayerRG8", (512, 512, 3), "uint8"),
    ):
        assert shared.configure(CameraSettings(pixel_format=name)).pixel_format == name
        shared.arm(ArmSpec(name, 1, 1.0))
        shared.software_trigger()
        (frame,) = shared.wait_frames(1, 1.0)
        assert frame.pixels is not None
        assert frame.pixels.shape == shape
        assert frame.pixels.dtype == kind
        assert frame.pixels.max() > frame.pixels.min()
