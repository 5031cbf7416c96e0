"""Simulated cameras behind the common interface: edges in, frames out, every fault."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_rigs import lens, placed, report

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import ArmSpec, CameraSettings, Frame, FrameStatus, TriggerKind
from rig.acquisition.timingboard.reading import read_board
from rig.acquisition.trigger.box import FireReport
from rig.simulation.backend import SimulatedBackend
from rig.simulation.faults import CameraFaults
from rig.simulation.flatsettings import BoardSettings, PlaceSettings, TargetSettings
from rig.simulation.motion import knocked, rotation_by
from rig.simulation.previews import preview_camera
from rig.simulation.settings import LightSettings, SceneSettings, SensorSettings, SimulationSettings

REPO = Path(__file__).resolve().parents[3]
RIG = tuple(
    placed(lens(120), (x, -900.0, 0.0), name)
    for name, x in (("cam01", -200.0), ("cam02", 0.0), ("cam03", 200.0))
)
EMPTY = SceneSettings(with_head=False)
BASE = SimulationSettings(scene=EMPTY, workers=0, exposure_us=2000.0, readout_ms=5.0, seed=3)
DEADLINE_S = 0.3

Maker = Callable[..., SimulatedBackend]


@pytest.fixture
def backend_of() -> Iterator[Maker]:
    made: list[SimulatedBackend] = []

    def make(faults: CameraFaults | None = None, **changes: object) -> SimulatedBackend:
        wrong = {} if faults is None else {"cam02": faults}
        settings = replace(BASE, faults=wrong, **changes)
        made.append(SimulatedBackend(RIG, settings))
        return made[-1]

    yield make
    for backend in made:
        backend.close()


def capture(
    backend: SimulatedBackend,
    number: int = 1,
    shots: int = 1,
    delays_us: dict[int, float] | None = None,
    wait_s: float = DEADLINE_S,
) -> tuple[int, dict[str, list[Frame]]]:
    """Arm all, fire outputs 1 to 3, wait; the instant of the first edge and the frames."""
    names = [info.id for info in backend.discover()]
    devices = {name: backend.open(name) for name in names}
    spec = ArmSpec(f"capture {number}", shots, DEADLINE_S)
    for device in devices.values():
        device.arm(spec)
    at = time.monotonic_ns()
    delays = delays_us or {1: 0.0, 2: 0.0, 3: 0.0}
    backend.expose(report(spec.capture_id, at, delays, shots, 40_000.0))
    return at, {name: list(device.wait_frames(shots, wait_s)) for name, device in devices.items()}


def test_cameras_are_those_of_the_rig_with_their_names_as_ids(backend_of: Maker) -> None:
    backend = backend_of()
    assert [info.id for info in backend.discover()] == ["cam01", "cam02", "cam03"]
    assert {info.backend for info in backend.discover()} == {"simulated"}
    with pytest.raises(DeviceError, match="no-such-camera") as caught:
        backend.open("no-such-camera")
    assert caught.value.code == "device/camera-gone"


def test_a_frame_says_when_it_was_exposed_and_when_it_came(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(lag_mean_us=700.0))
    at, frames = capture(backend, delays_us={1: 0.0, 2: 100.0, 3: 0.0})
    (frame,) = frames["cam02"]
    assert frame.camera_id == "cam02"
    assert frame.status is FrameStatus.OK
    assert frame.pixels is not None
    assert frame.pixels.shape == (90, 120, 3)
    assert frame.exposure_us == 2000.0
    # Edge + lag + exposure + readout.
    assert frame.arrived_host_ns == at + 100_000 + 700_000 + 2_000_000 + 5_000_000
    device = backend.open("cam02")
    (sample,) = device.clock_samples(1)
    assert frame.device_ns is not None
    # Device and host clocks drift apart by 20 ppm at most over the second that has passed.
    since = (sample.host_before_ns + sample.host_after_ns) // 2 - (at + 800_000)
    assert sample.device_ns - frame.device_ns == pytest.approx(since, abs=100_000 + since * 2e-5)


def test_a_report_heard_twice_fires_once_and_one_without_edges_not_at_all(
    backend_of: Maker,
) -> None:
    backend = backend_of()
    device = backend.open("cam01")
    device.arm(ArmSpec("c", 1, DEADLINE_S))
    told = report("c", time.monotonic_ns(), {1: 0.0})
    backend.expose(replace(told, edges=()))
    backend.expose(told)
    backend.expose(told)
    time.sleep(0.05)
    assert len(device.wait_frames(2, 0.05)) == 1


def test_edges_before_arming_expose_nothing(backend_of: Maker) -> None:
    backend = backend_of()
    device = backend.open("cam01")
    before = time.monotonic_ns() - 1_000_000
    device.arm(ArmSpec("c", 1, DEADLINE_S))
    backend.expose(report("c", before, {1: 0.0}))
    assert device.wait_frames(1, 0.02) == ()
    device.disarm()
    backend.expose(report("d", time.monotonic_ns(), {1: 0.0}))
    assert device.wait_frames(1, 0.02) == ()


def test_a_burst_gives_its_frames_in_order_with_counters_and_times(backend_of: Maker) -> None:
    _, frames = capture(backend_of(counter_start=65534), shots=3)
    for found in frames.values():
        assert [frame.counter for frame in found] == [65535, 0, 1]
        stamps = np.array([frame.device_ns for frame in found], dtype=np.int64)
        assert np.abs(np.diff(stamps) - 40_000_000).max() < 1000 + 40_000_000 * 2e-5


@pytest.mark.slow
def test_slow_rendering_makes_no_frame_late_and_loses_none(backend_of: Maker) -> None:
    """The caller's own clock has run out when the first picture is there; all are handed over."""
    # A light that no other test has, so that its shadows are still to be found.
    light = LightSettings((123.0, -1000.0, 456.0), 1.0)
    backend = backend_of(scene=SceneSettings(lights=(light,)))
    devices = [backend.open(name) for name in ("cam01", "cam02")]
    for device in devices:
        device.arm(ArmSpec("c", 2, DEADLINE_S))
    backend.expose(report("c", time.monotonic_ns(), {1: 0.0, 2: 0.0}, 2, 20_000.0))
    began = time.monotonic()
    frames = devices[0].wait_frames(2, 0.1)
    took = time.monotonic() - began
    assert took > DEADLINE_S, "making the head ready takes longer than the deadline"
    assert [frame.status for frame in frames] == [FrameStatus.OK] * 2
    assert len(devices[1].wait_frames(2, 0.1)) == 2


def test_frames_that_nobody_fetched_are_dropped_and_counted_at_the_next_arming(
    backend_of: Maker,
) -> None:
    backend = backend_of()
    device = backend.open("cam01")
    for number in (1, 2):
        device.arm(ArmSpec(f"c{number}", 1, DEADLINE_S))
        backend.expose(report(f"c{number}", time.monotonic_ns(), {1: 0.0}))
        time.sleep(0.03)
    assert device.health().counters["stale_frames"] == 1
    (frame,) = device.wait_frames(1, DEADLINE_S)
    assert frame.counter == 2
    device.arm(ArmSpec("c3", 1, DEADLINE_S))
    assert device.health().counters["stale_frames"] == 1


def test_settings_come_back_as_the_camera_has_them(backend_of: Maker) -> None:
    device = backend_of().open("cam01")
    wanted = CameraSettings(1234.4, 3.14, None, 8.0, "Mono16")
    real = device.configure(wanted)
    assert real == CameraSettings(1234.0, 3.1, None, 8.0, "Mono16")
    assert device.configure(CameraSettings()) == real
    assert device.configure(CameraSettings(iso=400)).iso is None
    for refused in (
        CameraSettings(exposure_us=0.0),
        CameraSettings(gain_db=90.0),
        CameraSettings(f_number=float("nan")),
        CameraSettings(pixel_format="YUV"),
    ):
        with pytest.raises(InputError) as caught:
            device.configure(refused)
        assert caught.value.code == "input/camera-setting"
    assert device.configure(CameraSettings()) == real


def test_exposure_gain_and_format_reach_the_picture(backend_of: Maker) -> None:
    backend = backend_of()
    device = backend.open("cam01")
    levels = []
    for number, settings in enumerate(
        (CameraSettings(1000.0, 0.0, None, 16.0, "Mono16"), CameraSettings(2000.0, 6.0))
    ):
        device.configure(settings)
        _, frames = capture(backend, number)
        pixels = frames["cam01"][0].pixels
        assert pixels is not None
        assert pixels.dtype == np.uint16
        levels.append(pixels.mean())
    # Twice the time and 10 ** (6 / 20) of gain; noise of 10,800 pixels averages to a thousandth.
    assert levels[1] / levels[0] == pytest.approx(2.0 * 10.0 ** (6.0 / 20.0), rel=0.01)


@pytest.mark.parametrize(
    ("faults", "frames", "lost"),
    [
        (CameraFaults(drop=1.0, only_shots=(2,)), [1, 3], "lost_frames"),
        (CameraFaults(miss=1.0, only_shots=(2,)), [1, 2], "missed_triggers"),
        (CameraFaults(duplicate=1.0, only_shots=(2,)), [1, 2, 2, 3], ""),
    ],
)
def test_lost_missed_and_doubled_frames_show_in_the_counter(
    backend_of: Maker, faults: CameraFaults, frames: list[int], lost: str
) -> None:
    backend = backend_of(faults)
    device = backend.open("cam02")
    device.arm(ArmSpec("c", 3, DEADLINE_S))
    backend.expose(report("c", time.monotonic_ns(), {2: 0.0}, 3, 20_000.0))
    found = device.wait_frames(99, DEADLINE_S)
    assert [frame.counter for frame in found] == frames
    if lost:
        assert device.health().counters[lost] == 1
    arrivals = [frame.arrived_host_ns for frame in found]
    assert arrivals == sorted(arrivals)


def test_an_edge_during_an_exposure_is_missed(backend_of: Maker) -> None:
    backend = backend_of(exposure_us=30_000.0)
    device = backend.open("cam01")
    device.arm(ArmSpec("c", 3, DEADLINE_S))
    backend.expose(report("c", time.monotonic_ns(), {1: 0.0}, 3, 20_000.0))
    assert len(device.wait_frames(3, 0.2)) == 2
    assert device.health().counters["missed_triggers"] == 1


def test_a_late_frame_comes_after_its_deadline_and_says_so(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(late=1.0, late_ms=400.0))
    at, frames = capture(backend)
    assert frames["cam02"] == []
    assert len(frames["cam01"]) == 1
    device = backend.open("cam02")
    (late,) = device.wait_frames(1, 1.0)
    assert late.status is FrameStatus.LATE
    assert late.arrived_host_ns == at + 407_000_000


def test_a_late_frame_reaches_into_the_next_capture(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(late=1.0, late_ms=400.0, only_shots=(1,)))
    capture(backend, 1)
    _, frames = capture(backend, 2, wait_s=0.4)
    found = backend.open("cam02").wait_frames(2, 0.4)
    assert sorted(frame.counter or 0 for frame in found) == [1, 2]
    assert len(frames["cam01"]) == 1


def test_black_incomplete_and_wrong_size_frames(backend_of: Maker) -> None:
    for fault in ("black", "incomplete", "wrong_size"):
        backend = backend_of(CameraFaults(**{fault: 1.0}))
        _, frames = capture(backend)
        (good,), (bad,) = frames["cam01"], frames["cam02"]
        assert good.pixels is not None
        assert bad.pixels is not None
        if fault == "black":
            assert good.pixels.mean() > 30.0 > 8.0 > bad.pixels.mean()
            assert bad.status is FrameStatus.OK
        elif fault == "incomplete":
            assert bad.status is FrameStatus.INCOMPLETE
            assert bad.pixels[60:].max() == 0
            assert bad.pixels[:60].mean() > 30.0
        else:
            assert bad.pixels.shape == (45, 60, 3)
            assert bad.status is FrameStatus.OK


def test_an_extra_frame_at_the_start_comes_without_an_edge(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(extra_frame_at_start=True))
    device = backend.open("cam02")
    device.arm(ArmSpec("c", 1, DEADLINE_S))
    assert len(device.wait_frames(1, DEADLINE_S)) == 1
    backend.expose(report("c", time.monotonic_ns(), {2: 0.0}))
    assert len(device.wait_frames(2, DEADLINE_S)) == 2


def test_a_free_running_camera_heeds_no_trigger(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(free_running=True, free_run_interval_ms=50.0))
    device = backend.open("cam02")
    device.arm(ArmSpec("c", 1, DEADLINE_S))
    found = device.wait_frames(3, 0.5)
    assert len(found) == 3
    stamps = np.array([frame.device_ns for frame in found], dtype=np.int64)
    assert np.abs(np.diff(stamps) - 50_000_000).max() < 5000
    backend.expose(report("c", time.monotonic_ns(), {2: 0.0}))
    device.disarm()
    count = len(device.wait_frames(99, 0.1))
    assert len(device.wait_frames(99, 0.1)) == count


def test_swapped_cables_expose_at_the_other_output(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(swapped_to_output=3))
    at, frames = capture(backend, delays_us={1: 0.0, 2: 10_000.0, 3: 30_000.0})
    assert frames["cam02"][0].arrived_host_ns - at == 37_000_000


def test_a_timestamp_reset_shows_in_the_stamps_and_in_the_clock(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(timestamp_reset_at_shot=2))
    _, frames = capture(backend, shots=3)
    stamps = [frame.device_ns or 0 for frame in frames["cam02"]]
    # The clock begins again a millisecond before the second exposure.
    assert stamps[1] == pytest.approx(1_000_000, abs=100)
    assert stamps[2] == pytest.approx(41_000_000, abs=2000)
    assert stamps[0] > stamps[2] or stamps[0] < 0
    (sample,) = backend.open("cam02").clock_samples(1)
    assert 41_000_000 < sample.device_ns < 60_000_000_000


def test_a_knocked_camera_stands_elsewhere_from_that_shot_on(backend_of: Maker) -> None:
    card = TargetSettings("charuco", PlaceSettings((0.0, 0.0, 0.0)), 30.0)
    there = SceneSettings(with_head=False, targets=(card,))
    moved, turned = (3.0, -2.0, 5.0), (0.4, -0.3, 1.0)
    faults = CameraFaults(moved_mm=moved, turned_deg=turned, knocked_at_shot=2)
    one, other = backend_of(faults, scene=there), backend_of(scene=there)
    for number in (1, 2):
        shaken, still = (capture(b, number)[1] for b in (one, other))
        for name in ("cam01", "cam02", "cam03"):
            same = np.array_equal(shaken[name][0].pixels, still[name][0].pixels)
            assert same == (name != "cam02" or number == 1)
    place = knocked(RIG[1], moved, turned)
    corner = np.array([[10.0, 20.0, 30.0]])
    # What stood at the corner before the camera's eye stands there still, seen from elsewhere.
    seen = RIG[1].pose.to_camera(corner) - moved
    assert np.allclose(place.pose.to_camera(corner), seen @ rotation_by(np.radians(turned)))


def test_an_unplugged_camera_is_gone_until_it_is_plugged_in_again(backend_of: Maker) -> None:
    backend = backend_of(CameraFaults(unplug_at_shot=2))
    device = backend.open("cam02")
    device.arm(ArmSpec("c", 2, DEADLINE_S))
    began = time.monotonic()
    backend.expose(report("c", time.monotonic_ns(), {2: 0.0}, 2, 10_000.0))
    time.sleep(0.03)
    found = device.wait_frames(2, 5.0)
    assert time.monotonic() - began < 2.0, "nothing more comes, so nothing is waited for"
    assert [frame.counter for frame in found] == [1]
    assert not device.health().connected
    assert "cam02" in device.health().problem
    assert [info.id for info in backend.discover()] == ["cam01", "cam03"]
    with pytest.raises(DeviceError, match="cam02") as caught:
        device.arm(ArmSpec("d", 1, DEADLINE_S))
    assert caught.value.code == "device/camera-gone"
    with pytest.raises(DeviceError):
        backend.open("cam02")
    backend.replug("cam02")
    again = backend.open("cam02")
    again.arm(ArmSpec("e", 1, DEADLINE_S))
    backend.expose(report("e", time.monotonic_ns(), {2: 0.0}))
    (frame,) = again.wait_frames(1, DEADLINE_S)
    assert frame.counter == 2


def test_software_triggers_are_refused_unless_switched_on(backend_of: Maker) -> None:
    edge = backend_of().open("cam01")
    edge.arm(ArmSpec("c", 1, DEADLINE_S))
    with pytest.raises(InputError) as refused:
        edge.software_trigger()
    assert refused.value.code == "input/camera-trigger"
    device = backend_of(trigger="software").open("cam01")
    assert device.capabilities.trigger is TriggerKind.SOFTWARE
    with pytest.raises(DeviceError) as unready:
        device.software_trigger()
    assert unready.value.code == "device/camera-not-ready"
    device.arm(ArmSpec("c", 1, DEADLINE_S))
    device.software_trigger()
    assert len(device.wait_frames(1, DEADLINE_S)) == 1


def test_closing_twice_changes_nothing_and_a_closed_camera_does_not_answer(
    backend_of: Maker,
) -> None:
    backend = backend_of()
    device = backend.open("cam01")
    device.close()
    device.close()
    with pytest.raises(DeviceError):
        device.arm(ArmSpec("c", 1, DEADLINE_S))
    assert backend.open("cam01").health().connected
    backend.close()
    backend.close()


def test_names_of_cameras_that_are_not_there_are_refused() -> None:
    with pytest.raises(InputError, match="cam99"):
        SimulatedBackend(RIG, replace(BASE, faults={"cam99": CameraFaults()}))
    with pytest.raises(InputError, match="no cameras"):
        SimulatedBackend((), BASE)


class QuietBox:
    """Of a trigger box only what the cameras use: it tells its listeners of reports."""

    def __init__(self) -> None:
        self.listeners: list[Callable[[FireReport], None]] = []

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        self.listeners.append(listener)
        return lambda: self.listeners.remove(listener)


def test_a_box_is_listened_to_from_another_thread_until_closing() -> None:
    box = QuietBox()
    with SimulatedBackend(RIG, BASE, box) as backend:
        device = backend.open("cam01")
        device.arm(ArmSpec("c", 1, DEADLINE_S))
        told = report("c", time.monotonic_ns() + 20_000_000, {1: 0.0})
        thread = threading.Timer(0.05, box.listeners[0], [told])
        thread.start()
        assert len(device.wait_frames(1, 2.0)) == 1
        thread.join()
    assert box.listeners == []


@pytest.mark.parametrize("sync_output", [None, 4])
def test_the_timing_board_shows_the_lag_of_every_camera(sync_output: int | None) -> None:
    """Edges of the box, lag, picture of the LEDs, reader: to a twentieth of a millisecond."""
    rig = tuple(
        placed(lens(900), (x, -900.0, 0.0), name, (0.0, 0.0, 0.0), 900.0)
        for name, x in (("cam01", -200.0), ("cam02", 200.0))
    )
    board = BoardSettings(PlaceSettings((0.0, 0.0, 0.0)), sync_output=sync_output)
    lags = {"cam01": 1234.0, "cam02": 8300.0}
    settings = replace(
        BASE,
        scene=replace(EMPTY, board=board),
        sensor=SensorSettings(reference_exposure_us=2000.0),
        faults={name: CameraFaults(lag_mean_us=lag) for name, lag in lags.items()},
        pixel_format="Mono8",
    )
    delays = {1: 0.0, 2: 500.0, 4: 250.0}
    with SimulatedBackend(rig, settings) as backend:
        at, frames = capture(backend, 1, 2, delays)
    zero_us = at * 1e-3 if sync_output is None else -250.0
    for number, (name, lag) in enumerate(lags.items(), 1):
        for shot, frame in enumerate(frames[name]):
            assert frame.pixels is not None
            found = read_board(frame.pixels, board.board, exposure_us=frame.exposure_us)
            edge = zero_us + delays[number]
            if sync_output is None:
                edge += shot * 40_000.0
            off = found.mid_us - 1000.0 - edge - lag
            period = board.board.range_us
            assert abs((off + period / 2.0) % period - period / 2.0) < 50.0
    assert len(frames["cam01"]) == len(frames["cam02"]) == 2


SCRIPT = """
import sys, time
sys.path[:0] = ["tests/support"]
from simulated_rigs import lens, placed, report
from rig.acquisition.cameras.base import ArmSpec
from rig.simulation.backend import SimulatedBackend
from rig.simulation.settings import SceneSettings, SimulationSettings

def main(workers):
    rig = [placed(lens(120), (x, -900.0, 0.0), n) for n, x in (("cam01", 0.0), ("cam02", 100.0))]
    settings = SimulationSettings(SceneSettings(with_head=False), workers=workers, seed=5)
    with SimulatedBackend(rig, settings) as backend:
        devices = [backend.open(camera.name) for camera in rig]
        for device in devices:
            device.arm(ArmSpec("c", 1, 5.0))
        backend.expose(report("c", time.monotonic_ns(), {1: 0.0, 2: 0.0}))
        if workers and len(sys.argv) > 1:
            devices[0].wait_frames(1, 5.0)
            from multiprocessing import active_children
            print(*(child.pid for child in active_children()), flush=True)
            time.sleep(60)
        for device in devices:
            (frame,) = device.wait_frames(1, 5.0)
            print(frame.pixels.shape, int(frame.pixels.astype(int).sum()))

if __name__ == "__main__":
    main(2)
    if len(sys.argv) == 1:
        main(0)
"""


@pytest.mark.slow
def test_processes_render_what_a_thread_renders(tmp_path: Path) -> None:
    script = tmp_path / "run.py"
    script.write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, cwd=REPO, check=True, timeout=60,
        env={"PYTHONPATH": str(REPO), "PATH": ""},
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert len(lines) == 4
    assert lines[:2] == lines[2:]
    assert lines[0] != lines[1]


@pytest.mark.slow
def test_processes_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "run.py"
    script.write_text(SCRIPT)
    parent = subprocess.Popen(
        [sys.executable, script, "stay"], stdout=subprocess.PIPE, text=True, cwd=REPO,
        env={"PYTHONPATH": str(REPO), "PATH": ""},
    )  # fmt: skip
    assert parent.stdout is not None
    with parent:
        children = [int(word) for word in parent.stdout.readline().split()]
        parent.kill()
    assert children
    until = time.monotonic() + 5.0
    while any(alive(child) for child in children) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(alive(child) for child in children)


def alive(process: int) -> bool:
    status = Path(f"/proc/{process}/stat")
    # A zombie has ended; that nobody asks how is the test machine's affair.
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def test_a_look_is_quick_to_make_and_changes_no_capture(backend_of: Maker) -> None:
    scene = replace(
        EMPTY, targets=(TargetSettings("aruco", PlaceSettings((0.0, -40.0, 0.0)), 80.0),)
    )
    pixels = []
    for looks in (0, 2):
        backend = backend_of(scene=scene)
        device = backend.open("cam02")
        for _ in range(looks):
            seen = device.preview(lambda: False)
            assert seen is not None and seen.pixels is not None and seen.pixels.max() > 100
        assert device.preview(lambda: True) is None
        assert device.health().counters["exposures"] == 0
        _, frames = capture(backend)
        pixels.append(frames["cam02"][0].pixels)
        assert frames["cam02"][0].counter == BASE.counter_start + 1
    np.testing.assert_array_equal(pixels[0], pixels[1])


def test_a_look_has_few_pixels_of_the_same_view() -> None:
    camera = placed(lens(2000, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0)))
    small = preview_camera(camera)
    assert small.camera.image_size_px == (500, 375)
    points = np.array([[30.0, -60.0, 20.0], [-70.0, 10.0, -60.0]])
    whole, _ = camera.camera.project(camera.pose, points)
    found, _ = small.camera.project(small.pose, points)
    np.testing.assert_allclose((found + 0.5) * 4 - 0.5, whole, atol=1e-9)
    assert preview_camera(RIG[0]).camera.image_size_px == RIG[0].camera.image_size_px
