"""Captures with folder cameras: real files that arrive badly, through a whole rig."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image
from PIL.ExifTags import Base
from tethered import CAMERAS, Tethered, held, jpeg, station

from common.errors import ConflictError, InputError
from rig.acquisition.capture.filememory import recall
from rig.acquisition.session.folder import Session
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.session.verify import verify_session
from rig.acquisition.station.spec import CameraPlan
from rig.acquisition.synchrony.fileevidence import FileEvidence
from rig.devices.station import open_station


def test_sound_pictures_are_given_by_their_times(tethered: Tethered) -> None:
    record = tethered.capture("one", tethered.sound(1))
    assert record.state == "complete", record.faults
    assert not record.faults
    assert {frame.method for frame in record.frames} == {"file-time"}


def test_the_previous_file_renamed_after_arming_is_held_back(tethered: Tethered) -> None:
    tethered.capture("one", tethered.sound(1))

    def deliver(fired: datetime) -> None:
        before = tethered.root / "cam01" / "DSC_0001.JPG"
        before.rename(before.with_name("subject.JPG"))
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0002.JPG", fired)

    record = tethered.capture("two", deliver)
    assert record.missing == {"cam01": [1]}
    assert "cam01: subject.JPG is held back: it is DSC_0001.JPG once more" in held(record)


def test_a_file_missed_in_one_shot_is_not_taken_for_the_next(tethered: Tethered) -> None:
    tethered.capture("one", tethered.sound(1))
    late: list[datetime] = []

    def lacking(fired: datetime) -> None:
        late.append(fired)
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0002.JPG", fired)

    assert tethered.capture("two", lacking).missing == {"cam01": [1]}
    time.sleep(1.2)

    def landing(fired: datetime) -> None:
        tethered.write("cam01", "DSC_0002.JPG", late[0])
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0003.JPG", fired)

    record = tethered.capture("three", landing)
    assert record.missing == {"cam01": [1]}
    assert "of capture two, and came late" in held(record)


def test_a_file_of_years_ago_is_held_back(tethered: Tethered) -> None:
    def deliver(fired: datetime) -> None:
        tethered.write("cam01", "DSC_0001.JPG", fired - timedelta(days=2000, seconds=400))
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0001.JPG", fired)

    record = tethered.capture("one", deliver)
    assert record.missing == {"cam01": [1]}
    assert "s off the shot" in held(record)


def test_an_identical_double_is_kept_once(tethered: Tethered) -> None:
    def deliver(fired: datetime) -> None:
        tethered.sound(1)(fired)
        for name in CAMERAS:
            folder = tethered.root / name
            shutil.copyfile(folder / "DSC_0001.JPG", folder / "DSC_0001 (copy).JPG")

    record = tethered.capture("one", deliver)
    assert record.state == "complete"
    assert {fault.kind for fault in record.faults} == {"duplicate"}


def test_half_a_file_that_is_renamed_when_whole_is_of_the_shot_before(tethered: Tethered) -> None:
    part = tethered.root / "cam01" / "DSC_0001.tmp"
    part.write_bytes(b"half")

    def deliver(fired: datetime) -> None:
        part.write_bytes(jpeg(None, 99))
        part.rename(part.with_suffix(".JPG"))
        for name in CAMERAS[1:]:
            tethered.write(name, "DSC_0001.JPG", fired)

    record = tethered.capture("one", deliver)
    assert record.missing == {"cam01": [1]}
    assert "DSC_0001.tmp once more" in held(record)


def test_a_pipe_among_the_files_stops_nobody(tethered: Tethered) -> None:
    os.mkfifo(tethered.root / "cam01" / "DSC_0000.JPG")
    assert tethered.capture("one", tethered.sound(1)).state == "complete"


def test_a_raw_file_that_comes_later_joins_its_shot_or_is_told(tmp_path: Path) -> None:
    root = tmp_path / "tether"
    both = frozenset({"image/jpeg", "image/png"})
    with (
        open_station(station(root, kinds=both), locks=tmp_path / "locks") as rig,
        rig.new_session(tmp_path / "session") as session,
    ):
        made = Tethered(rig, session, root)

        def pairs(fired: datetime) -> None:
            made.sound(1)(fired)
            time.sleep(0.4)
            for name in CAMERAS:
                picture = Image.open(root / name / "DSC_0001.JPG")
                data = BytesIO()
                picture.save(data, "PNG")
                (root / name / "DSC_0001.PNG").write_bytes(data.getvalue())

        record = made.capture("one", pairs)
        assert record.state == "complete", record.faults
        lacking = made.capture("two", made.sound(2))
        assert {fault.kind for fault in lacking.faults} == {"file-missing"}
        assert lacking.state == "partial" and not lacking.missing


def test_of_two_files_of_one_exposure_none_is_written_over_the_other(tethered: Tethered) -> None:
    small, large = [], []

    def deliver(fired: datetime) -> None:
        for name in CAMERAS:
            for slot, scale, kept in (("slot1", 4, large), ("slot2", 1, small)):
                (tethered.root / name / slot).mkdir()
                kept.append(jpeg(fired, 7, scale=scale) + name.encode())
                (tethered.root / name / slot / "DSC_0001.JPG").write_bytes(kept[-1])

    record = tethered.capture("one", deliver)
    assert record.state == "complete"
    assert len({frame.file.path for frame in record.frames}) == len(record.frames) == 3
    filed = {frame.metadata["sha256"] for frame in record.frames}
    assert filed == {hashlib.sha256(data).hexdigest() for data in large}
    assert held(record).count("a larger file of the same exposure is kept") == 3
    assert verify_session(tethered.session.folder).whole


def test_a_file_that_is_written_into_after_it_came_is_filed_once(tethered: Tethered) -> None:
    def deliver(fired: datetime) -> None:
        tethered.sound(1)(fired)
        # Taken after 0.05 s, and looked for more of its kind until 0.2 s.
        time.sleep(0.12)
        path = tethered.root / CAMERAS[-1] / "DSC_0001.JPG"
        picture = Image.open(BytesIO(path.read_bytes()))
        exif = picture.getexif()
        exif[Base.Copyright] = "the laboratory"
        picture.save(path, "JPEG", exif=exif)

    record = tethered.capture("one", deliver)
    assert record.state == "complete"
    assert len(record.frames) == 3 and not record.faults


def test_thumbnails_are_no_pictures(tethered: Tethered) -> None:
    tethered.capture("one", tethered.sound(1))

    def deliver(fired: datetime) -> None:
        for place in ("@eaDir/DSC_0001.JPG/XL.jpg", ".thumbnails/large/x.jpg", "small.jpg"):
            path = tethered.root / "cam01" / place
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(jpeg(None, len(place)))
        time.sleep(0.4)
        tethered.sound(2)(fired)

    record = tethered.capture("two", deliver)
    assert record.state == "complete"
    assert {frame.metadata["file"] for frame in record.frames} == {"DSC_0002.JPG"}
    assert "cam01: small.jpg is held back: it tells no time" in held(record)


def test_a_run_of_its_own_goes_on_where_the_session_s_last_run_ended(tmp_path: Path) -> None:
    """A clock never set is learned over two runs; a late picture of the run before is held."""
    root, off = tmp_path / "tether", timedelta(days=-4000, seconds=433)

    def run(number: int, deliver: Callable[[Tethered, datetime], None]) -> CaptureRecord:
        with open_station(station(root), locks=tmp_path / "locks") as rig:
            again = (tmp_path / "session").exists()
            session = Session.open(tmp_path / "session") if again else None
            with session or rig.new_session(tmp_path / "session") as session:
                made = Tethered(rig, session, root)
                made.seed = 10 * number
                return made.capture(f"run{number}", lambda fired: deliver(made, fired))

    def first(made: Tethered, fired: datetime) -> None:
        made.write("cam01", "DSC_0001.JPG", fired + off)
        made.write("cam02", "DSC_0001.JPG", fired)

    def second(made: Tethered, fired: datetime) -> None:
        made.write("cam01", "DSC_0002.JPG", fired + off)
        made.write("cam02", "DSC_0002.JPG", fired)
        made.write("cam03", "late.JPG", None)

    assert run(1, first).missing == {"cam01": [1], "cam03": [1]}
    # Nearer shots cannot be told apart where somebody else fires within the deadline.
    time.sleep(1.5)
    record = run(2, second)
    assert record.missing == {"cam03": [1]}, record.faults
    assert "cam03: late.JPG is held back: it tells no time, and an earlier picture" in held(record)


def test_old_files_that_are_touched_or_put_there_are_no_pictures(tmp_path: Path) -> None:
    root = tmp_path / "tether"
    plan = station(root)
    bytes_of_old = jpeg(None, 1)
    touched = root / "cam01" / "portrait.JPG"
    touched.write_bytes(bytes_of_old)
    os.utime(touched, (1e9, 1e9))
    with (
        open_station(plan, locks=tmp_path / "locks") as rig,
        rig.new_session(tmp_path / "session") as session,
    ):
        made = Tethered(rig, session, root)
        made.seed = 10

        def deliver(fired: datetime) -> None:
            touched.write_bytes(bytes_of_old)
            aside = tmp_path / "old.JPG"
            aside.write_bytes(jpeg(None, 2))
            os.utime(aside, (1e9, 1e9))
            aside.rename(root / "cam02" / "old.JPG")
            made.write("cam03", "DSC_0001.JPG", fired)

        record = made.capture("one", deliver)
    assert record.missing == {"cam01": [1], "cam02": [1]}
    assert "cam01: portrait.JPG is held back: it is portrait.JPG once more" in held(record)
    assert "cam02: old.JPG is held back: it tells no time, and was last written 2001" in held(
        record
    )


def test_locks_go_by_folder_and_not_by_name(tmp_path: Path) -> None:
    one, other = station(tmp_path / "a"), station(tmp_path / "b")
    locks = tmp_path / "locks"
    with open_station(one, locks=locks), open_station(other, locks=locks):
        link = tmp_path / "link"
        link.symlink_to(tmp_path / "a")
        renamed = {"root": str(link), "cameras": {"left": "cam01"}}
        same = replace(
            one,
            cameras=(CameraPlan("left", "folder", "left"),),
            backend_options={"folder": renamed},
        )
        with pytest.raises(ConflictError, match=r"folder .*cam01 is in use"):
            open_station(same, locks=locks)
    twice = {"root": str(tmp_path / "a"), "cameras": {"left": "cam01", "right": "cam01"}}
    plans = (CameraPlan("left", "folder", "left"), CameraPlan("right", "folder", "right"))
    with pytest.raises(InputError, match=r"'left' and 'right' have the same folder"):
        open_station(replace(one, cameras=plans, backend_options={"folder": twice}), locks=locks)


def test_records_that_cannot_be_teach_nothing(tethered: Tethered) -> None:
    record = tethered.capture("one", tethered.sound(1))
    (frame, *others) = record.frames
    damaged = (
        record.model_copy(update={"fired_at": "yesterday"}),
        record.model_copy(update={"frames": [frame.model_copy(update={"shot": 99}), *others]}),
        record.model_copy(update={"frames": [frame.model_copy(update={"method": "luck"})]}),
    )
    recall(FileEvidence(), tethered.rig.station, damaged, CAMERAS)
