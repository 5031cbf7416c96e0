"""Every fault a camera can have, through a whole capture: a sound picture or a named fault."""

from __future__ import annotations

import random
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from memorybench import BenchMaker
from memoryrig import CameraScript, memory_station, with_camera, with_policy
from PIL import Image

from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.session.verify import verify_session
from rig.acquisition.synchrony.imagechecks import check_image

SHOTS = 3
BAD = frozenset({2})

FAULTS = [
    ("drop", CameraScript(drop=BAD), {"missing", "counter-gap"}, [2]),
    ("miss", CameraScript(miss=BAD), {"missing"}, [2]),
    ("duplicate", CameraScript(duplicate=BAD), {"duplicate"}, []),
    ("late", CameraScript(late=BAD), {"late"}, []),
    ("black", CameraScript(black=BAD), {"black"}, []),
    ("incomplete", CameraScript(incomplete=BAD), {"incomplete"}, []),
    ("extra at start", CameraScript(extra_at_start=True), {"extra-at-start"}, []),
    ("free running", CameraScript(free_running_s=0.012), {"free-running", "missing"}, [1, 2, 3]),
    ("clock reset", CameraScript(clock_reset=True), {"timestamp-reset", "by-arrival"}, []),
    ("unplugged", CameraScript(unplugged=True), {"missing"}, [1, 2, 3]),
    ("lag off", CameraScript(lag_us=9000.0), {"lag-off", "missing"}, [1, 2, 3]),
    ("cut file", CameraScript(encoded=b"\xff\xd8 no picture"), {"unreadable"}, []),
    ("no fault, over the counter's wrap", CameraScript(first_counter=65533), set(), []),
]
HARMLESS = {"duplicate", "extra-at-start", "by-arrival", "late", "counter-gap"}


@pytest.mark.parametrize(
    ("script", "kinds", "missing"), [row[1:] for row in FAULTS], ids=[row[0] for row in FAULTS]
)
def test_a_fault_is_named_and_harms_nobody_else(
    bench: BenchMaker, script: CameraScript, kinds: set[str], missing: list[int]
) -> None:
    station = with_policy(memory_station(), frame_deadline_s=0.12, settle_s=0.03)
    made = bench(station, {"cam02": script})
    result = made.rig.capture(made.session, "burst", shots=SHOTS, interval_us=40_000.0)
    record = result.record
    assert {fault.kind for fault in record.faults} == kinds
    assert {fault.camera for fault in record.faults if fault.kind != "by-arrival"} <= {"cam02"}
    assert record.missing == ({"cam02": missing} if missing else {})
    for frame in record.frames:
        assert frame.metadata["truth"] == f"{made.box.fired[0]}/{frame.shot}"
    whole = kinds <= HARMLESS
    assert record.state == ("complete" if whole else "partial")
    assert (result.error is None) == whole
    if result.error is not None:
        assert "cam02" in str(result.error)
    assert verify_session(made.session.folder).whole


def test_a_wrong_size_is_told_where_the_size_is_known(bench: BenchMaker) -> None:
    station = with_camera(memory_station(), "cam02", image_size_px=(64, 48))
    made = bench(station, {"cam02": CameraScript(wrong_size=frozenset({1}))})
    record = made.rig.capture(made.session, "smile").record
    assert [fault.kind for fault in record.faults] == ["wrong-size"]
    assert "32 x 24 pixels, 64 x 48 are expected" in record.faults[0].text
    assert record.state == "partial"


@pytest.mark.parametrize(
    ("method", "kinds"),
    [("wait_frames", ["missing"]), ("configure", ["not-ready"]), ("disarm", [])],
)
def test_a_backend_that_fails_costs_its_own_camera_only(
    bench: BenchMaker, monkeypatch: pytest.MonkeyPatch, method: str, kinds: list[str]
) -> None:
    made = bench()

    def fail(*_: object) -> None:
        raise OSError("the library fell over")

    monkeypatch.setattr(made.devices.camera("cam02"), method, fail)
    record = made.rig.capture(made.session, "smile", allow_partial=True).record
    assert [fault.kind for fault in record.faults] == kinds
    assert all("OSError: the library fell over" in fault.text for fault in record.faults)
    assert len(record.frames) == (2 if kinds else 3)


def test_a_file_that_a_camera_made_is_looked_at(bench: BenchMaker) -> None:
    def jpeg(level: int, size: tuple[int, int]) -> bytes:
        buffer = BytesIO()
        Image.new("RGB", size, (level, level, level)).save(buffer, "JPEG")
        return buffer.getvalue()

    station = with_camera(memory_station(3), "cam03", image_size_px=(64, 48))
    whole = jpeg(120, (64, 48))
    made = bench(
        station,
        {
            "cam01": CameraScript(encoded=jpeg(2, (64, 48))),
            "cam02": CameraScript(encoded=whole[:-40]),
            "cam03": CameraScript(encoded=jpeg(120, (32, 48))),
        },
    )
    record = made.rig.capture(made.session, "smile").record
    assert {(f.camera, f.kind) for f in record.faults} == {
        ("cam01", "black"),
        ("cam02", "unreadable"),
        ("cam03", "wrong-size"),
    }


def test_stale_pictures_never_reach_the_next_capture(bench: BenchMaker) -> None:
    """A picture that comes after its capture is over belongs to nobody."""
    station = with_policy(memory_station(), frame_deadline_s=0.05)
    made = bench(station, {"cam02": CameraScript(late=frozenset({1}), readout_s=0.03)})
    first = made.rig.capture(made.session, "one").record
    assert first.missing == {"cam02": [1]}
    made.devices.camera("cam02").script = CameraScript()
    second = made.rig.capture(made.session, "two").record
    assert second.state == "complete"
    assert {frame.metadata["truth"] for frame in second.frames} == {f"{made.box.fired[1]}/1"}


def test_swapped_cables_are_seen_by_their_delays(bench: BenchMaker) -> None:
    station = with_camera(memory_station(), "cam02", delay_us=3000.0)
    made = bench(
        station,
        {"cam01": CameraScript(wired_to=2), "cam02": CameraScript(wired_to=1)},
    )
    record = made.rig.capture(made.session, "smile").record
    swapped = [fault for fault in record.faults if fault.kind == "swapped"]
    assert len(swapped) == 1 and "outputs 1 and 2 look swapped" in swapped[0].text
    assert record.state == "partial"


def test_swapped_cables_of_equal_delay_do_no_harm(bench: BenchMaker) -> None:
    made = bench(
        scripts={"cam01": CameraScript(wired_to=2), "cam02": CameraScript(wired_to=1)},
    )
    record = made.rig.capture(made.session, "smile").record
    assert record.state == "complete" and not record.faults
    assert record.verdict.state == "synchronised"


@pytest.mark.parametrize("seed", range(3))
def test_random_bursts_with_random_faults_have_no_wrong_pair(bench: BenchMaker, seed: int) -> None:
    draw = random.Random(seed)  # noqa: S311  faults, not secrets
    station = with_policy(memory_station(4), frame_deadline_s=0.1, settle_s=0.005)

    def some() -> frozenset[int]:
        return frozenset(k for k in range(1, 6) if draw.random() < 0.15)

    scripts = {
        camera.name: CameraScript(
            lag_us=draw.uniform(0.0, 1500.0),
            jitter_us=50.0,
            drop=some(),
            miss=some(),
            duplicate=some(),
            extra_at_start=draw.random() < 0.3,
        )
        for camera in station.cameras
    }
    scripts = {k: replace(v, lag_us=v.lag_us + 200.0) for k, v in scripts.items()}
    made = bench(station, scripts)
    for number in range(4):
        record = made.rig.capture(
            made.session, f"burst{number}", shots=5, interval_us=12_000.0
        ).record
        for frame in record.frames:
            assert frame.metadata["truth"] == f"{made.box.fired[number]}/{frame.shot}"
        for camera, script in scripts.items():
            lost = sorted(script.drop | script.miss)
            assert record.missing.get(camera, []) == lost
    assert verify_session(made.session.folder).whole


@pytest.mark.parametrize(
    ("level", "dtype", "black"),
    [(8, np.uint8, True), (40, np.uint8, False), (800, np.uint16, True), (3000, np.uint16, False)],
)
def test_what_counts_as_black(level: int, dtype: type, black: bool) -> None:
    """A dark frame's noise does, a face in poor light does not."""
    noise = np.random.default_rng(3).normal(level, level / 8.0, (120, 160))
    frame = Frame("SN", 0, FrameStatus.OK, pixels=noise.clip(0).astype(dtype))
    assert check_image(frame).black == black


@pytest.mark.parametrize("kept", [-900, 60])
def test_a_picture_that_was_cut_off_is_called_that(bench: BenchMaker, kept: int) -> None:
    whole = BytesIO()
    noise = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
    Image.fromarray(noise).save(whole, "JPEG")
    made = bench(scripts={"cam02": CameraScript(encoded=whole.getvalue()[:kept])})
    record = made.rig.capture(made.session, "cut").record
    texts = [fault.text for fault in record.faults if fault.kind == "unreadable"]
    assert texts == ["cam02: the picture of shot 1 was cut off on its way"]
