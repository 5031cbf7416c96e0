"""Against the GenTL producer that comes with the genicam package: three virtual cameras."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from camera_rigs import viky

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import ArmSpec, CameraSettings, TimestampKind, TriggerKind
from rig.acquisition.cameras.genicam import PRODUCERS, GenicamBackend, find_producers

pytestmark = pytest.mark.needs_genicam


@pytest.fixture
def backend() -> Iterator[GenicamBackend]:
    backend = GenicamBackend(producers=[viky()])
    yield backend
    backend.close()


def test_all_cameras_of_a_producer_run_at_once(backend: GenicamBackend) -> None:
    ids = [info.id for info in backend.discover()]
    assert len(ids) == 3
    cameras = [backend.open(name) for name in ids]
    assert len({camera.info.address for camera in cameras}) == 3
    for camera in cameras:
        camera.arm(ArmSpec("all", 2, 2.0))
    frames = [camera.wait_frames(2, 2.0)[0] for camera in cameras]
    assert [frame.camera_id for frame in frames] == ids
    means = [
        frame.pixels.reshape(-1, 3).mean(axis=0) for frame in frames if frame.pixels is not None
    ]
    # Red, green, blue: each camera's own colour is its brightest.
    assert [int(mean.argmax()) for mean in means] == [0, 1, 2]


def test_what_the_producer_lacks_is_declared(backend: GenicamBackend) -> None:
    can = backend.open("0").capabilities
    assert can.trigger is TriggerKind.NONE
    assert can.timestamps is TimestampKind.NONE
    assert can.frame_counter
    assert can.settable == {"pixel_format"}


def test_the_pixel_format_changes_the_picture(backend: GenicamBackend) -> None:
    camera = backend.open("1")
    shapes = []
    for name in ("Mono8", "RGBa8"):
        camera.configure(CameraSettings(pixel_format=name))
        camera.arm(ArmSpec("a", 1, 2.0))
        frame = camera.wait_frames(1, 2.0)[0]
        assert frame.pixels is not None
        shapes.append(frame.pixels.shape)
    assert shapes == [(400, 400), (400, 400, 3)]


def test_a_camera_running_freely_does_not_fill_the_memory(backend: GenicamBackend) -> None:
    camera = backend.open("2")
    camera.arm(ArmSpec("a", 1, 1.0))
    frames = camera.wait_frames(40, 1.5)
    assert 17 <= len(frames) <= 17 + 1  # one shot and the spare ones; the oldest go
    assert camera.health().counters["overrun_frames"] > 0
    counters = [frame.counter for frame in frames if frame.counter is not None]
    assert counters == list(range(counters[0], counters[0] + len(counters)))


def test_an_option_for_all_cameras_that_one_lacks_does_no_harm() -> None:
    backend = GenicamBackend(producers=[viky()], ptp=True, ptp_wait_s=0.1, trigger="software")
    with contextlib.closing(backend):
        assert backend.open("0").capabilities.timestamps is TimestampKind.NONE


def test_producers_come_from_the_standard_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PRODUCERS, str(Path(viky()).parent))
    assert viky() in find_producers(())
    monkeypatch.setenv(PRODUCERS, "")
    with pytest.raises(InputError) as none:
        GenicamBackend()
    assert none.value.code == "input/camera-producer"
    with pytest.raises(InputError, match=r"no-such"):
        GenicamBackend(producers=["no-such.cti"])


def test_a_producer_that_is_none_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.cti"
    broken.write_text("no library")
    backend = GenicamBackend(producers=[str(broken)])
    with pytest.raises(DeviceError):
        backend.open("0")


def test_a_producer_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "maker.cti"
    broken.write_text("no library")
    backend = GenicamBackend(producers=[str(broken)])
    with pytest.raises(
        DeviceError, match=r"the producer .*maker\.cti cannot be loaded \(.*too short"
    ):
        backend.discover()
    # One that works is not kept from working by another one that does not.
    assert len(GenicamBackend(producers=[str(broken), viky()]).discover()) == 3
