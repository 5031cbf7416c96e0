"""A station file opened for real: driver, fake box on a serial line, simulated cameras, session."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.verify import verify_session
from rig.acquisition.station.delays import write_timings
from rig.acquisition.station.stationfile import read_station
from rig.design.designfile import placed_camera
from rig.devices.simulated import simulation_settings
from rig.devices.station import open_station
from rig.specification.examples import example_rig

pytest.importorskip("rig.simulation.backend")
pytest.importorskip("rig.devices.registry")
pytest.importorskip("rig.acquisition.trigger.driver")

STATION = """
# Three cameras before a timing board.
schema = "rigwright.station/1"
design = "design.json"

[trigger]
url = "fake:"

{cameras}

[led]
outputs = [15]
[led.board]
bits = 8
pitch_mm = 17.0
row_gap_mm = 12.0
led_diameter_mm = 4.0
marker_mm = 25.0

[capture]
frame_deadline_s = 60.0
settle_s = 0.02
min_free_mb = 1.0
skew_limit_us = 300.0

[simulation]
workers = 0
exposure_us = 4000.0
readout_ms = 5.0
[simulation.scene]
with_head = false
[simulation.scene.board.place]
position_rig_mm = [0.0, -60.0, 0.0]
{faults}
"""
CAMERA = """
[[camera]]
name = "cam0{k}"
backend = "simulated"
id = "cam0{k}"
output = {k}
"""
LAGS_US = {"cam01": 100.0, "cam02": 900.0, "cam03": 2300.0}


def faults(**more: str) -> str:
    lines = []
    for name, lag in LAGS_US.items():
        lines += [f"[simulation.faults.{name}]", f"lag_mean_us = {lag}", more.get(name, "")]
    return "\n".join(lines)


@contextmanager
def opened(folder: Path, fault_text: str) -> Iterator[tuple[Rig, Path]]:
    camera = example_rig("face").camera
    camera = replace(
        camera,
        image_size_px=(400, 267),
        pixel_pitch_mm=camera.pixel_pitch_mm * 10.0,
        principal_point_px=np.full(2, np.nan),
    )
    cameras = []
    for k, across in enumerate((-120.0, 0.0, 120.0), start=1):
        pose = Pose.looking_at(np.array([across, -680.0, 20.0]), np.array([0.0, -60.0, 0.0]))
        cameras.append(RigCamera(f"cam{k:02d}", camera, pose, 630.0))
    design = {
        "schema": "rigwright.design/1",
        "name": "three",
        "cameras": [placed_camera(c) for c in cameras],
    }
    (folder / "design.json").write_text(json.dumps(design))
    path = folder / "station.toml"
    listed = "".join(CAMERA.format(k=k) for k in (1, 2, 3))
    path.write_text(STATION.format(cameras=listed, faults=fault_text))
    with open_station(read_station(path), locks=folder / "locks") as rig:
        yield rig, path


def test_lags_are_found_by_stamps_and_by_light_and_written_back(tmp_path: Path) -> None:
    """From a file to a synchronised rig. The issue asks for 0.1 ms; both levels must give it."""
    with opened(tmp_path, faults()) as (rig, path):
        assert rig.self_test(tmp_path).ok
        session = rig.new_session(tmp_path / "session", "board")
        before = rig.capture(session, "before").record
        assert before.state == "complete", before.faults
        assert before.verdict.level == "C" and before.verdict.state == "not-synchronised"
        for camera in before.cameras:
            assert camera.lag_us == pytest.approx(LAGS_US[camera.name], abs=100.0)
        assert before.optical is not None and not before.optical.unread
        for reading in before.optical.readings:
            assert reading.lag_us == pytest.approx(LAGS_US[reading.camera], abs=100.0)
        check = rig.sync_check(2, pause_s=0.0)
        assert check.timings is not None
        assert {e.source for e in check.lags.values()} == {"optical"}
        write_timings(path, check.timings)
        rig.adopt(check.timings)
        after = rig.capture(session, "after").record
        assert after.verdict.state == "synchronised", after.verdict.text
        assert verify_session(session.folder).whole
        session.close()
    assert "# Three cameras before a timing board." in path.read_text()
    delays = {camera.name: camera.delay_us for camera in read_station(path).cameras}
    assert delays["cam03"] == 0.0
    assert delays["cam01"] == pytest.approx(2200.0, abs=100.0)


@pytest.mark.parametrize(
    ("fault", "kinds"),
    [
        ("drop = 1.0\nonly_shots = [1]", {"missing"}),
        ("duplicate = 1.0\nonly_shots = [1]", {"duplicate"}),
        ("black = 1.0\nonly_shots = [1]", {"black"}),
        ("wrong_size = 1.0\nonly_shots = [1]", {"wrong-size"}),
        ("incomplete = 1.0\nonly_shots = [1]", {"incomplete"}),
        ("free_running = true\nfree_run_interval_ms = 15.0", {"free-running", "missing"}),
        ("timestamp_reset_at_shot = 1", {"timestamp-reset", "by-arrival"}),
        ("unplug_at_shot = 1", {"missing"}),
    ],
)
def test_faults_of_simulated_cameras_are_named(tmp_path: Path, fault: str, kinds: set[str]) -> None:
    with opened(tmp_path, faults(cam02=fault)) as (rig, _):
        rig.station = replace(
            rig.station, board=None, policy=replace(rig.station.policy, frame_deadline_s=2.0)
        )
        with rig.new_session(tmp_path / "session") as session:
            record = rig.capture(session, "one").record
            assert {f.kind for f in record.faults} == kinds
            assert {f.camera for f in record.faults if f.kind != "by-arrival"} == {"cam02"}
            assert verify_session(session.folder).whole


def test_the_simulation_section_is_read_strictly(tmp_path: Path) -> None:
    with opened(tmp_path, faults()) as (rig, path):
        settings = simulation_settings(rig.station)
    assert settings.faults["cam03"].lag_mean_us == 2300.0
    assert settings.scene.board is not None
    assert settings.scene.board.sync_output == 15 and settings.scene.board.board.bits == 8
    text = path.read_text()
    for wrong, right, word in (
        ("with_haed", "with_head", "did you mean with_head"),
        ("lag_men_us", "lag_mean_us", "did you mean lag_mean_us"),
        ("exposure_us = -1.0", "exposure_us = 4000.0", "exposure_us of the simulation is -1"),
    ):
        path.write_text(text.replace(right, wrong))
        with pytest.raises(InputError) as error:
            simulation_settings(read_station(path))
        assert word in str(error.value)


FOLDER_STATION = """
schema = "rigwright.station/1"
[trigger]
url = "fake:"
[[camera]]
name = "left"
backend = "folder"
id = "left"
output = 1
[[camera]]
name = "right"
backend = "folder"
id = "right"
output = 2
[capture]
frame_deadline_s = 3.0
settle_s = 0.01
min_free_mb = 1.0
[backend.folder]
root = "{root}"
trigger = "edge"
settle_s = 0.05
"""


def test_files_that_tethering_software_fetches(tmp_path: Path) -> None:
    """The box fires; another program puts the files into folders, one of them late and alone."""
    pytest.importorskip("rig.acquisition.cameras.folder")
    from PIL import Image

    root = tmp_path / "tether"
    for name in ("left", "right"):
        (root / name).mkdir(parents=True)
    path = tmp_path / "station.toml"
    path.write_text(FOLDER_STATION.format(root=root))
    with open_station(read_station(path), locks=tmp_path / "locks") as rig:
        assert rig.box is not None
        wanted = ["left", "right"]

        def fetch(report: object) -> None:  # noqa: ARG001
            for name in wanted:
                # No two exposures are alike: the same bytes again would be the same picture.
                picture = Image.effect_noise((64, 48), 80.0)
                picture.save(root / name / f"{name}-{3 - len(wanted)}.jpg")

        rig.box.subscribe(fetch)
        with rig.new_session(tmp_path / "session") as session:
            whole = rig.capture(session, "both").record
            assert whole.state == "complete"
            assert {f.kind for f in whole.faults} == {"by-arrival"}
            assert whole.verdict.level == "A" and whole.verdict.state == "unproven"
            wanted.remove("right")
            rig.station = replace(
                rig.station, policy=replace(rig.station.policy, frame_deadline_s=0.3)
            )
            half = rig.capture(session, "one")
            assert half.record.missing == {"right": [1]}
            assert half.error is not None and "right" in str(half.error)
            assert verify_session(session.folder).whole
