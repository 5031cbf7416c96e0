from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from camera_rigs import jpeg
from PIL import Image
from trigger_boxes import wait_until

from common.errors import DeviceError, InputError, NotFoundError
from rig.acquisition.cameras import reach
from rig.acquisition.cameras.base import ArmSpec, CameraSettings, TriggerKind
from rig.acquisition.cameras.folder import FolderBackend

SHOT = ArmSpec("a", 1, 5.0)
SETTLE_S = 0.1


def folder(root: Path, **options: object) -> FolderBackend:
    return FolderBackend(root=str(root), settle_s=SETTLE_S, **options)


def test_a_file_still_being_written_is_waited_for(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    data, path = jpeg("1"), tmp_path / "left" / "a.jpg"
    path.write_bytes(data[:-40])
    # Its size does not change for long, as with a slow cable; yet it is not all there.
    assert camera.wait_frames(1, 4 * SETTLE_S) == ()
    assert camera.health().counters["unfinished_files"] == 1
    with path.open("ab") as file:
        file.write(data[-40:])
    (frame,) = camera.wait_frames(1, 2.0)
    assert frame.encoded == data
    assert camera.health().counters["unfinished_files"] == 0


def test_a_file_written_drop_by_drop_comes_whole(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    data = jpeg("1")

    def write() -> None:
        with (tmp_path / "left" / "a.jpg").open("wb", buffering=0) as file:
            for start in range(0, len(data), 100):
                file.write(data[start : start + 100])
                time.sleep(0.02)

    writer = threading.Thread(target=write)
    writer.start()
    (frame,) = camera.wait_frames(1, 5.0)
    writer.join()
    assert frame.encoded == data


def test_a_file_whose_room_was_made_first_is_waited_for(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    noise = np.random.default_rng(0).integers(1, 250, (90, 120, 3), np.uint8)
    made = BytesIO()
    Image.fromarray(noise).save(made, "TIFF")
    data, path = made.getvalue(), tmp_path / "left" / "a.tif"
    # Header, beginning and end are there: nothing that the header promises lies beyond the end.
    path.write_bytes(data[:9000] + bytes(len(data) - 12000) + data[-3000:])
    assert camera.wait_frames(1, 5 * SETTLE_S) == ()
    path.write_bytes(data)
    (frame,) = camera.wait_frames(1, 2.0)
    assert frame.encoded == data


def test_a_picture_that_is_truly_black_somewhere_comes_in_time(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(ArmSpec("a", 1, 1.0))
    Image.new("RGB", (120, 90)).save(tmp_path / "left" / "a.tif")
    assert len(camera.wait_frames(1, 1.0)) == 1


def test_a_file_half_there_when_armed_is_of_before(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    data, path = jpeg("1"), tmp_path / "left" / "late.jpg"
    path.write_bytes(data[:100])
    camera.arm(SHOT)
    path.write_bytes(data)
    assert camera.wait_frames(1, 3 * SETTLE_S) == ()


def test_a_file_written_anew_under_its_name_counts(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    path = tmp_path / "left" / "latest.jpg"
    path.write_bytes(jpeg("1"))
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    path.write_bytes(jpeg("22"))
    (frame,) = camera.wait_frames(1, 2.0)
    assert frame.metadata["BodySerialNumber"] == "22"


def test_what_the_file_says_of_itself_comes_along(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    (tmp_path / "left" / "a.jpg").write_bytes(jpeg("0012345", exposure=(1, 125)))
    (frame,) = camera.wait_frames(1, 2.0)
    assert frame.metadata["BodySerialNumber"] == "0012345"
    assert frame.metadata["file"] == "a.jpg"
    assert frame.exposure_us == 8000.0


def test_files_go_to_the_camera_whose_number_they_carry(tmp_path: Path) -> None:
    backend = folder(tmp_path, by="serial", cameras={"left": "111", "right": "222"})
    assert [info.id for info in backend.discover()] == ["left", "right"]
    left, right = backend.open("left"), backend.open("right")
    left.arm(SHOT)
    right.arm(SHOT)
    (tmp_path / "day" / "card").mkdir(parents=True)
    for name, serial in (("a", "222"), ("b", "111"), ("c", ""), ("d", "333")):
        (tmp_path / "day" / "card" / f"{name}.jpg").write_bytes(jpeg(serial))
    assert [f.metadata["file"] for f in left.wait_frames(1, 2.0)] == ["b.jpg"]
    assert [f.metadata["file"] for f in right.wait_frames(1, 2.0)] == ["a.jpg"]
    assert left.health().counters["frames"] == 1


def test_files_of_no_camera_are_told_and_those_of_others_are_not(tmp_path: Path) -> None:
    backend = folder(tmp_path, by="serial", cameras={"left": "111", "right": "222"})
    left = backend.open("left")
    left.arm(SHOT)
    for name, serial in (("b", "222"), ("c", ""), ("d", "333")):
        (tmp_path / f"{name}.jpg").write_bytes(jpeg(serial))
    assert left.wait_frames(1, 3 * SETTLE_S) == ()
    assert left.unread() == "c.jpg (it names no body), d.jpg (of body 333)"


def test_of_many_files_that_are_no_pictures_some_are_named(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path, suffixes=[".PNG"]).open("left")
    (tmp_path / "left" / "old.txt").touch()
    camera.arm(SHOT)
    (tmp_path / "left" / ".hidden").touch()
    for k in range(8):
        (tmp_path / "left" / f"{k}.jpg").touch()
    said = camera.unread()
    assert said.startswith("0.jpg (not of the kinds in 'suffixes'), 1.jpg")
    assert said.endswith("and 3 more") and "old.txt" not in said and "hidden" not in said


def test_what_came_between_two_armings_is_known(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    (tmp_path / "left" / "a.jpg").write_bytes(jpeg("1"))
    assert len(camera.wait_frames(1, 2.0)) == 1
    (tmp_path / "left" / "late.jpg").write_bytes(jpeg("1"))
    camera.arm(SHOT)
    assert [frame.metadata["file"] for frame in camera.between()] == ["late.jpg"]
    camera.arm(SHOT)
    assert camera.between() == ()


def test_numbers_seen_so_far_are_cameras(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(jpeg("111"))
    (tmp_path / "b.jpg").write_bytes(jpeg("222"))
    (tmp_path / "c.jpg").write_bytes(jpeg("111"))
    assert [i.id for i in folder(tmp_path, by="serial").discover()] == ["111", "222"]


def test_only_wanted_kinds_of_files_count(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path, suffixes=[".PNG"]).open("left")
    camera.arm(SHOT)
    (tmp_path / "left" / "a.jpg").write_bytes(jpeg("1"))
    (tmp_path / "left" / ".hidden.png").write_bytes(jpeg("1"))
    (tmp_path / "left" / "notes.txt").write_text("no picture")
    assert camera.wait_frames(1, 3 * SETTLE_S) == ()


def test_frames_of_before_are_counted_once(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    for k in range(3):
        (tmp_path / "left" / f"{k}.jpg").write_bytes(jpeg("1"))
    camera.arm(SHOT)
    camera.arm(SHOT)
    assert camera.health().counters["stale_frames"] == 3


def test_a_folder_that_goes_away_is_a_camera_that_is_gone(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    (tmp_path / "left").rmdir()
    with pytest.raises(DeviceError, match=r"camera left .*its folder") as caught:
        camera.arm(SHOT)
    assert caught.value.code == "device/camera-gone"
    assert camera.health().problem == "its folder is not there"


@pytest.fixture
def dead_share(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Folders answer nobody while the event is clear."""
    alive = threading.Event()
    alive.set()
    for name in ("is_dir", "stat"):
        whole = getattr(Path, name)

        def wait(self: Path, whole: Callable[..., Any] = whole, **how: Any) -> Any:  # noqa: ANN401
            alive.wait(20.0)
            return whole(self, **how)

        monkeypatch.setattr(Path, name, wait)
    yield alive
    alive.set()


def test_a_dead_network_share_holds_nobody(
    tmp_path: Path, dead_share: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "left").mkdir()
    backend = folder(tmp_path)
    camera = backend.open("left")
    dead_share.clear()
    began = time.monotonic()
    for _ in range(4):
        assert "does not answer" in camera.health().problem
    monkeypatch.setattr(reach.answered, "__defaults__", (0.2,))
    with pytest.raises(DeviceError, match="did not answer within"):
        folder(tmp_path)
    with pytest.raises(DeviceError, match="did not answer within"):
        backend.open("left")
    # One look that is waited for, two openings of 0.2 s; a slow machine may take as long again.
    assert time.monotonic() - began < 5.0
    dead_share.set()
    wait_until(lambda: camera.health().connected)


def test_the_box_may_fire_these_cameras(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path, trigger="edge").open("left")
    assert camera.capabilities.trigger is TriggerKind.EDGE
    assert camera.capabilities.settable == frozenset()
    with pytest.raises(InputError, match=r"only seen through its files"):
        camera.configure(CameraSettings(exposure_us=1.0))


def test_wrong_options_are_named(tmp_path: Path) -> None:
    for options, word in (
        ({"root": str(tmp_path / "no")}, "no folder"),
        ({"root": str(tmp_path), "by": "colour"}, "'by'"),
        ({"root": str(tmp_path), "settel_s": 1}, "'settel_s'"),
        ({}, "'root'"),
    ):
        with pytest.raises(InputError, match=word) as caught:
            FolderBackend(**options)
        assert caught.value.code == "input/camera-option"
    with pytest.raises(NotFoundError, match=r"known: none"):
        folder(tmp_path).open("left")


def black_below(colour: int) -> bytes:
    """A TIFF of one colour whose lower half is black, as room that is not yet filled."""
    half = np.zeros((90, 120, 3), np.uint8)
    half[:45] = colour
    made = BytesIO()
    Image.fromarray(half).save(made, "TIFF")
    return made.getvalue()


def test_a_picture_that_may_yet_be_filled_is_there_when_nobody_waits_longer(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera = folder(tmp_path).open("left")
    camera.arm(SHOT)
    (tmp_path / "left" / "a.tif").write_bytes(black_below(80))
    assert camera.wait_frames(1, 3 * SETTLE_S) == ()
    assert len(camera.wait_frames(1, 0.0)) == 1


def test_shots_of_one_name_that_are_black_somewhere_are_two(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    camera, path = folder(tmp_path).open("left"), tmp_path / "left" / "latest.tif"
    camera.arm(ArmSpec("a", 2, 0.4))
    for colour in (80, 160):
        path.write_bytes(black_below(colour))
        camera.wait_frames(2, 5 * SETTLE_S)
    assert len(camera.wait_frames(2, 0.0)) == 2
