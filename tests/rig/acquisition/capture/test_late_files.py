"""Folder cameras after a miss: late files, files that are no pictures, folders that blink."""

from __future__ import annotations

import os
import shutil
import threading
import time
from datetime import datetime, timedelta
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image
from tethered import CAMERAS, Tethered, held, jpeg, station

from common.errors import CancelledError
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.folder import Session
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.session.staging import Stage
from rig.acquisition.session.verify import verify_session
from rig.devices.station import open_station


def told(record: CaptureRecord, kind: str) -> str:
    return "; ".join(fault.text for fault in record.faults if fault.kind == kind)


def raw_of(picture: Path) -> bytes:
    """A TIFF of the same picture, as raw files are built."""
    made = BytesIO()
    with Image.open(picture) as image:
        image.save(made, "TIFF", exif=image.getexif())
    return made.getvalue()


@pytest.mark.slow
def test_the_first_good_pictures_after_a_miss_are_filed(tethered: Tethered) -> None:
    assert set(tethered.capture("one", lambda _: None).missing) == set(CAMERAS)
    # Nearer shots cannot be told apart where somebody else fires within the deadline.
    time.sleep(3.0)
    record = tethered.capture("two", tethered.sound(2))
    assert record.state == "complete", record.faults


def test_a_raw_file_that_comes_after_the_capture_is_told_and_then_waited_for(
    tethered: Tethered,
) -> None:
    def late(number: int, delay_s: float) -> None:
        time.sleep(delay_s)
        for name in CAMERAS:
            path = tethered.root / name / f"DSC_{number:04d}.JPG"
            path.with_suffix(".NEF").write_bytes(raw_of(path))

    record = tethered.capture("one", tethered.sound(1))
    assert record.state == "complete"
    late(1, 0.0)

    def second(fired: datetime) -> None:
        tethered.sound(2)(fired)
        late(2, 0.6)

    record = tethered.capture("two", second)
    for name in CAMERAS:
        assert f"{name}: DSC_0001.NEF is held back: it came after capture one" in held(record)
    filed = {(frame.camera, frame.metadata["file"]) for frame in record.frames}
    assert filed == {(n, f"DSC_0002.{kind}") for n in CAMERAS for kind in ("JPG", "NEF")}


def test_a_miss_names_what_came_and_is_no_picture(tethered: Tethered) -> None:
    def deliver(fired: datetime) -> None:
        folder = tethered.root / "cam01"
        (folder / "notes.txt").write_text("no picture")
        (folder / "DSC_0001.XMP").write_text("<x/>")
        (folder / "DSC_0001.JPG").touch()
        (folder / "DSC_0002.JPG").write_bytes(jpeg(fired, 5)[:-200])
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0001.JPG", fired)

    record = tethered.capture("one", deliver)
    text = told(record, "missing")
    for word in (
        "notes.txt (no picture by its name)",
        "DSC_0001.XMP (no picture by its name)",
        "DSC_0001.JPG (empty)",
        "DSC_0002.JPG (not whole",
    ):
        assert word in text
    assert "cam02" not in text


def test_names_that_are_no_text_cost_nothing(tethered: Tethered) -> None:
    """Programs on other systems write names in encodings of their own."""
    latin, junk = (os.fsdecode(name) for name in (b"M\xfcller 1.JPG", b"caf\xe9\n\x1b[31m.txt"))

    def deliver(fired: datetime) -> None:
        tethered.write("cam01", latin, fired)
        (tethered.root / "cam02" / junk).write_text("no picture")
        tethered.write("cam03", "DSC_0001.JPG", fired)

    record = tethered.capture("one", deliver)
    names = {frame.camera: frame.metadata["file"] for frame in record.frames}
    assert names == {"cam01": r"M\xfcller 1.JPG", "cam03": "DSC_0001.JPG"}
    assert r"caf\xe9\n\x1b[31m.txt (no picture by its name)" in told(record, "missing")
    assert verify_session(tethered.session.folder).whole


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read all")
def test_a_miss_names_what_may_not_be_read(tethered: Tethered) -> None:
    def deliver(fired: datetime) -> None:
        tethered.write("cam01", "DSC_0001.JPG", fired)
        (tethered.root / "cam01" / "DSC_0001.JPG").chmod(0)

    assert "DSC_0001.JPG (Permission denied)" in told(tethered.capture("one", deliver), "missing")


@pytest.mark.parametrize("empty", [False, True])
@pytest.mark.parametrize("after_s", [0.0, 0.02])
def test_a_folder_that_blinks_loses_no_picture(
    tethered: Tethered, empty: bool, after_s: float
) -> None:
    for name in CAMERAS:
        tethered.write(name, "DSC_0000.JPG", datetime.now() - timedelta(days=1))
    root, aside = tethered.root, tethered.root.with_name("aside")

    def deliver(fired: datetime) -> None:
        tethered.sound(1)(fired)
        time.sleep(after_s)
        root.rename(aside)
        if empty:
            for name in CAMERAS:
                (root / name).mkdir(parents=True)
        time.sleep(0.15)
        if empty:
            shutil.rmtree(root)
        # As after a remount: the same files under other node numbers.
        shutil.copytree(aside, root)

    record = tethered.capture("one", deliver)
    assert record.state == "complete", record.faults
    assert not record.faults


@pytest.mark.parametrize("empty", [False, True])
def test_a_folder_that_blinks_while_its_camera_is_armed(tethered: Tethered, empty: bool) -> None:
    tethered.capture("one", tethered.sound(1))
    root, aside = tethered.root, tethered.root.with_name("aside")
    root.rename(aside)
    if empty:
        for name in CAMERAS:
            (root / name).mkdir(parents=True)

    def back() -> None:
        time.sleep(0.15)
        if empty:
            shutil.rmtree(root)
        shutil.copytree(aside, root)

    threading.Thread(target=back).start()
    record = tethered.capture("two", tethered.sound(2), delay_s=0.4)
    assert record.state == "complete", record.faults
    assert not record.faults


def silent(tethered: Tethered, number: int) -> None:
    """Every camera's picture of a shot, by a program that writes no times."""
    for name in CAMERAS:
        tethered.write(name, f"DSC_{number:04d}.JPG", None)


@pytest.mark.parametrize("end", ["aborted", "killed", "both programs end"])
def test_late_pictures_of_an_interrupted_capture_are_not_those_of_the_next(
    tmp_path: Path, end: str
) -> None:
    root, folder = tmp_path / "tether", tmp_path / "session"

    def second(tethered: Tethered) -> CaptureRecord:
        return tethered.capture("two", lambda _: silent(tethered, 1))

    def opened() -> Rig:
        return open_station(station(root), locks=tmp_path / "locks")

    record = None
    with opened() as rig, rig.new_session(folder) as session:
        tethered = Tethered(rig, session, root)
        if end == "killed":
            # All that is left on the disk of a program that was killed after the shot.
            Stage(session, "one").may_fire("box", 1, 0.0)
        else:
            with pytest.raises(CancelledError):
                tethered.capture("one", lambda _: rig.abort())
        if end == "aborted":
            record = second(tethered)
    if record is None:
        with opened() as rig, Session.open(folder) as session:
            record = second(Tethered(rig, session, root))
    assert set(record.missing) == set(CAMERAS)
    assert "an earlier picture has not come" in held(record)


def test_the_wait_goes_on_when_a_picture_of_another_time_comes_first(tethered: Tethered) -> None:
    tethered.capture("one", tethered.sound(1))

    def deliver(fired: datetime) -> None:
        tethered.write("cam01", "by hand.JPG", fired - timedelta(seconds=30.0))
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0002.JPG", fired)
        time.sleep(0.4)  # more than settle_s, within the deadline
        tethered.write("cam01", "DSC_0002.JPG", fired)

    record = tethered.capture("two", deliver)
    assert record.state == "complete", record.faults
    assert {f.metadata["file"] for f in record.frames} == {"DSC_0002.JPG"}


def test_a_program_that_starts_anew_tells_no_file_that_was_filed_or_lay_there(
    tmp_path: Path,
) -> None:
    """After a partial capture every young file was told as one that had come after it."""
    root, folder = tmp_path / "tether", tmp_path / "session"
    made = station(root)
    old = root / "cam01" / "by hand.JPG"
    old.write_bytes(jpeg(datetime.now(), 1000))
    before_s = time.time() - 60.0
    os.utime(old, (before_s, before_s))
    with open_station(made, locks=tmp_path / "locks") as rig, rig.new_session(folder) as session:
        tethered = Tethered(rig, session, root)
        tethered.capture("one", tethered.sound(1))
        tethered.capture("two", tethered.sound(2))

        def partial(fired: datetime) -> None:
            for name in CAMERAS[1:]:
                tethered.write(name, "DSC_0003.JPG", fired)

        assert tethered.capture("three", partial).missing == {"cam01": [1]}
    late = root / "cam01" / "DSC_0003.JPG"
    late.write_bytes(jpeg(datetime.now(), 1001))
    with open_station(made, locks=tmp_path / "locks") as rig, Session.open(folder) as session:
        tethered = Tethered(rig, session, root)
        tethered.seed = 2000
        record = tethered.capture("four", tethered.sound(4))
    assert held(record).count("is held back") == held(record).count("DSC_0003.JPG") == 1
