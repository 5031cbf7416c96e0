"""Real libraries that fail: a lossy network, a camera that dies, a body that makes no picture."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from camera_rigs import FAKE_GV, FakeGigE, one_gige_network
from memoryrig import with_policy

from common.errors import DeviceError
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.records import contradictions
from rig.acquisition.session.verify import verify_session
from rig.acquisition.station.spec import CameraPlan, Station
from rig.devices.station import open_station

pytestmark = pytest.mark.needs_aravis


def station(files: Path) -> Station:
    """A camera of files that never fails, and a network camera."""
    for number in range(12):
        picture = np.full((48, 64, 3), 60 + 10 * number, np.uint8)
        cv2.imwrite(str(files / f"f_{number:04d}.png"), picture)
    plans = (
        CameraPlan("cam1", "opencv", "files"),
        CameraPlan("cam2", "aravis", "LOSSY", lag_tolerance_us=500_000.0),
    )
    options = {
        "opencv": {"sources": {"files": str(files / "f_%04d.png")}},
        "aravis": {"trigger": "software", "addresses": {"LOSSY": "127.0.0.1"}},
    }
    made = Station("network", plans, backend_options=options)
    return with_policy(made, frame_deadline_s=2.0, min_free_mb=0.0, ready_deadline_s=20.0)


@contextlib.contextmanager
def cameras(tmp_path: Path, lost_per_1000: int) -> Iterator[tuple[Rig, FakeGigE]]:
    if shutil.which(FAKE_GV) is None:
        pytest.skip("no fake camera")
    with one_gige_network():
        bad = FakeGigE("LOSSY", lost_per_1000=lost_per_1000)
        try:
            (tmp_path / "files").mkdir()
            with open_station(station(tmp_path / "files"), locks=tmp_path / "locks") as rig:
                yield rig, bad
        finally:
            bad.stop()


def test_lost_packets_cost_their_camera_only(tmp_path: Path) -> None:
    with cameras(tmp_path, 30) as (rig, _), rig.new_session(tmp_path / "session") as session:
        worst = 0
        for number in range(4):
            result = rig.capture(session, f"c{number}")
            assert contradictions(result.record) == []
            assert "cam1" not in result.record.missing
            named = {f.camera for f in result.record.faults if f.kind in ("incomplete", "missing")}
            worst += named == {"cam2"}
            assert named <= {"cam2"}
            assert (result.error is None) == (not named)
        assert worst, "three packets of a hundred are lost"
        assert not session.manifest.interrupted
        assert verify_session(session.folder).whole


def test_a_camera_that_is_killed_before_its_trigger_is_missing(tmp_path: Path) -> None:
    with cameras(tmp_path, 0) as (rig, bad), rig.new_session(tmp_path / "session") as session:
        assert rig.capture(session, "before").record.state == "complete"

        def on(progress: object) -> None:
            if getattr(progress, "stage", "") == "firing":
                bad.stop()

        result = rig.capture(session, "killed", progress=on)
        assert result.record.missing == {"cam2": [1]}
        assert isinstance(result.error, DeviceError)
        assert "cam2" in str(result.error)
        assert verify_session(session.folder).whole


@pytest.mark.needs_gphoto2
def test_a_body_that_makes_no_picture_is_missing(tmp_path: Path) -> None:
    pytest.importorskip("gphoto2")
    (tmp_path / "empty").mkdir()
    options = {"gphoto2": {"trigger": "software", "virtual_folder": str(tmp_path / "empty")}}
    from rig.devices.registry import make_backend

    backend = make_backend("gphoto2", options["gphoto2"])
    try:
        body = backend.discover()[0].id
    finally:
        backend.close()
    made = Station("bodies", (CameraPlan("cam1", "gphoto2", body),), backend_options=options)
    made = with_policy(made, frame_deadline_s=3.0, min_free_mb=0.0, ready_deadline_s=30.0)
    with (
        open_station(made, locks=tmp_path / "locks") as rig,
        rig.new_session(tmp_path / "session") as session,
    ):
        result = rig.capture(session, "none")
        assert result.record.missing == {"cam1": [1]}
        assert result.record.state == "partial"
        assert result.error is not None
