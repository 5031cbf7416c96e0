"""Files that other programs fetch, given to their shots: none to a wrong one, whatever arrives."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import pytest

from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.synchrony.cameraframes import Pairing
from rig.acquisition.synchrony.faults import FaultKind
from rig.acquisition.synchrony.fileclocks import FileDelivery, FiredShot
from rig.acquisition.synchrony.fileevidence import FileEvidence
from rig.acquisition.synchrony.fileexposures import Span, file_exposures, file_time

SECOND = 1_000_000_000
NOON = datetime(2026, 11, 29, 12, tzinfo=UTC)
NOON_NS = round(NOON.timestamp()) * SECOND


def tags(at: datetime | None, digits: int = 0) -> dict[str, str]:
    if at is None:
        return {}
    said = {
        "DateTimeOriginal": at.strftime("%Y:%m:%d %H:%M:%S"),
        "OffsetTimeOriginal": "+00:00",
    }
    if digits:
        said["SubSecTimeOriginal"] = f"{at.microsecond:06d}"[:digits]
    return said


def picture(
    name: str, at: datetime | None, truth: str = "", digits: int = 0, kind: str = "image/jpeg"
) -> Frame:
    said = {**tags(at, digits), "file": name, "sha256": truth + kind, "truth": truth}
    return Frame("cam", 10**12, FrameStatus.OK, None, b"picture", kind, metadata=said)


def shots(number: int, at: datetime, count: int = 1, apart_s: float = 1.0) -> tuple[FiredShot, ...]:
    start = round(at.timestamp() * 1e9)
    return tuple(
        FiredShot(f"c{number}", k + 1, start + round(k * apart_s * SECOND)) for k in range(count)
    )


def sorted_one(
    evidence: FileEvidence, number: int, at: datetime, *frames: Frame, **more: object
) -> Pairing:
    given = FileDelivery("cam", frames, shots(number, at), 0, **more)
    return evidence.sort([given])["cam"][0]


def held(pairing: Pairing) -> str:
    return "; ".join(f.text for f in pairing.faults if f.kind is FaultKind.HELD_BACK)


def test_a_time_is_as_wide_as_its_last_digit() -> None:
    assert file_time(tags(NOON)) == Span(NOON_NS, NOON_NS + SECOND)
    half = NOON + timedelta(milliseconds=250)
    assert file_time(tags(half, 2)) == Span(NOON_NS + SECOND // 4, NOON_NS + 26 * SECOND // 100)
    assert file_time({}) is None
    assert file_time({"DateTimeOriginal": "0000:00:00 00:00:00"}) is None


def test_a_file_of_years_ago_is_held_back_and_named() -> None:
    old = picture("DSC_0001.JPG", NOON - timedelta(days=1234, seconds=777))
    result = sorted_one(FileEvidence(), 1, NOON, old)
    assert not result.pairs
    assert "DSC_0001.JPG is held back" in held(result)
    assert FaultKind.MISSING in {fault.kind for fault in result.faults}


def test_a_picture_that_lands_in_the_next_capture_is_told_to_be_of_the_one_before() -> None:
    evidence = FileEvidence()
    assert sorted_one(evidence, 1, NOON, picture("1.jpg", NOON)).pairs
    then, now = NOON + timedelta(seconds=20), NOON + timedelta(seconds=45)
    assert not sorted_one(evidence, 2, then).pairs
    result = sorted_one(evidence, 3, now, picture("2.jpg", then, "late"))
    assert not result.pairs
    assert "of capture c2, and came late" in held(result)
    both = sorted_one(
        evidence,
        4,
        now + timedelta(seconds=30),
        picture("3.jpg", now, "late too"),
        picture("4.jpg", now + timedelta(seconds=30), "right"),
    )
    assert [one.frame.metadata["truth"] for one in both.pairs] == ["right"]


def test_a_clock_that_is_off_is_learned_from_two_captures() -> None:
    evidence, off = FileEvidence(), timedelta(days=-400, seconds=17)
    assert not sorted_one(evidence, 1, NOON, picture("1.jpg", NOON + off, "a")).pairs
    for k, seconds in enumerate((31, 77, 90), start=2):
        at = NOON + timedelta(seconds=seconds)
        assert sorted_one(evidence, k, at, picture(f"{k}.jpg", at + off, str(k))).pairs


def test_a_clock_in_another_time_zone_is_no_matter() -> None:
    off = timedelta(hours=-5, minutes=-30)
    assert sorted_one(FileEvidence(), 1, NOON, picture("1.jpg", NOON + off)).pairs


def test_a_clock_off_by_the_pace_does_not_make_late_pictures_right() -> None:
    evidence, off, pace = FileEvidence(), timedelta(seconds=14.75), timedelta(seconds=15)
    assert not sorted_one(evidence, 0, NOON).pairs
    for k in (1, 2):
        at = NOON + k * pace
        assert not sorted_one(evidence, k, at, picture(f"{k}.jpg", at + off, str(k))).pairs
    for k in (4, 6):
        # By the picture of the shot before, fetched late, the clock would be set right.
        sorted_one(evidence, k - 1, NOON + (k - 1) * pace)
        late = picture(f"{k - 1}.jpg", NOON + (k - 1) * pace + off, "late")
        assert not sorted_one(evidence, k, NOON + k * pace, late).pairs


def test_of_two_pictures_none_is_taken_by_a_clock_that_nobody_has_compared() -> None:
    off = timedelta(seconds=20)
    by_hand = picture("1.jpg", NOON, "of twenty seconds before")
    own = picture("2.jpg", NOON + off, "own")
    assert not sorted_one(FileEvidence(), 1, NOON, by_hand, own).pairs


def test_doubles_are_kept_once_and_foreign_copies_held_back() -> None:
    first, again = picture("h1.JPG", NOON, "a"), picture("h1 (copy).JPG", NOON, "a")
    result = sorted_one(FileEvidence(), 1, NOON, first, again)
    assert len(result.pairs) == 1
    assert {fault.kind for fault in result.faults} == {FaultKind.DUPLICATE}
    ours, theirs = picture("a.jpg", NOON, "ours"), picture("b.jpg", NOON, "theirs")
    given = [
        FileDelivery("left", (ours,), shots(1, NOON), 0),
        FileDelivery("right", (theirs, ours), shots(1, NOON), 0),
    ]
    found = FileEvidence().sort(given)
    assert not found["left"][0].pairs, "nobody can tell whose it is"
    assert [one.frame.metadata["truth"] for one in found["right"][0].pairs] == ["theirs"]


def test_without_times_a_lost_picture_stops_the_guessing() -> None:
    evidence = FileEvidence()
    assert sorted_one(evidence, 1, NOON, picture("7.jpg", None, "a")).pairs
    assert not sorted_one(evidence, 2, NOON + timedelta(seconds=9)).pairs
    result = sorted_one(evidence, 3, NOON + timedelta(seconds=20), picture("8.jpg", None, "b"))
    assert not result.pairs and "cannot be told" in held(result)


def untimed(evidence: FileEvidence, *names: str) -> list[bool]:
    """Whether captures that bring a picture of each name, or none where it is "", are believed."""
    return [
        bool(
            sorted_one(
                evidence,
                k,
                NOON + timedelta(seconds=30 * k),
                *([picture(name, None, f"{k}")] if name else []),
            ).pairs
        )
        for k, name in enumerate(names)
    ]


def numbered(*numbers: int | None) -> list[str]:
    """Names of pictures with these numbers."""
    return ["" if n is None else f"DSC_{n:04d}.JPG" for n in numbers]


@pytest.mark.parametrize(
    ("numbers", "believed"),
    [
        ((9998, 9999, 1, 2), (1, 1, 1, 1)),
        ((9998, None, 1, 2), (1, 0, 1, 1)),  # 9999 was lost
        ((9998, None, 9999, 1), (1, 0, 0, 0)),  # late, or never made: nobody can tell
        ((9998, None, 1, 9999), (1, 0, 1, 0)),  # late beyond the end
        ((345, 1, 2, 3), (1, 0, 1, 1)),  # another card
        ((345, 12, 346, 347), (1, 0, 0, 0)),
        ((345, None, 347, 346, 348), (1, 0, 1, 0, 0)),
        ((7, None, 9, None, 11), (1, 0, 1, 0, 1)),
        ((9996, None, 3, 1), (1, 0, 0, 0)),  # another card twice: by its number the last is in turn
        ((9980, None, 3, 4, 1, 2), (1, 0, 0, 0, 0, 0)),
    ],
)
def test_numbers_tell_where_no_time_does(
    numbers: tuple[int | None, ...], believed: tuple[int, ...]
) -> None:
    assert untimed(FileEvidence(), *numbered(*numbers)) == [bool(one) for one in believed]


@pytest.mark.parametrize(
    ("names", "believed"),
    [
        (("0001_cam01.png", "0002_cam01.png", "0003_cam01.png"), (1, 1, 1)),
        (("IMG0007-1080p.png", "IMG0008-1080p.png"), (1, 1)),
        (("0001_cam2.png", "", "0003_cam2.png", "0004_cam2.png"), (1, 0, 1, 1)),
        (("0001_cam2.png", "", "0002_cam2.png"), (1, 0, 0)),
        (("ann_v2.png", "bob_v2.png"), (1, 1)),
        (("DSC_0008.png", "DSC_0008-edited.png"), (1, 0)),
    ],
)
def test_a_number_that_stays_does_not_count(
    names: tuple[str, ...], believed: tuple[int, ...]
) -> None:
    assert untimed(FileEvidence(), *names) == [bool(one) for one in believed]


@pytest.mark.parametrize("step_s", [3.0, -3.0, 60.0])
def test_a_clock_that_is_set_in_mid_session_costs_one_picture(step_s: float) -> None:
    """Also where the shots follow at so even a pace that a lag by one would look the same."""
    evidence, got = FileEvidence(), []
    for k in range(9):
        at = NOON + timedelta(seconds=15 * k)
        own = at + timedelta(seconds=step_s if k >= 3 else 0.0)
        frame = picture(f"DSC_{k + 1:04d}.JPG", own, str(k), digits=2)
        got.append(len(sorted_one(evidence, k, at, frame).pairs))
    assert got == [1, 1, 1, 0, 1, 1, 1, 1, 1]


def test_raw_files_come_beside_their_pictures_and_what_lacks_is_told() -> None:
    kinds = frozenset({"image/jpeg", "image/x-nikon-nef"})
    jpg = picture("D_1.JPG", NOON, "a")
    nef = picture("d_1.nef", NOON, "a", kind="image/x-nikon-nef")
    given = FileDelivery("cam", (nef, jpg), shots(1, NOON), 0, kinds=kinds)
    pairing, raws = FileEvidence().sort([given])["cam"]
    assert [one.frame.media_type for one in pairing.pairs] == ["image/jpeg"]
    assert raws is not None and len(raws.pairs) == 1
    assert not pairing.faults
    lone, _ = FileEvidence().sort([FileDelivery("cam", (jpg,), shots(1, NOON), 0, kinds=kinds)])[
        "cam"
    ]
    assert [fault.kind for fault in lone.faults] == [FaultKind.FILE_MISSING]


def test_a_raw_file_of_another_time_is_of_another_shot() -> None:
    kinds = frozenset({"image/jpeg", "image/x-nikon-nef"})
    jpg = picture("capt0000.jpg", NOON, "a")
    for when in (NOON - timedelta(days=365, seconds=77), NOON - timedelta(days=3)):
        nef = picture("capt0000.nef", when, "b", kind="image/x-nikon-nef")
        given = FileDelivery("cam", (nef, jpg), shots(1, NOON), 0, kinds=kinds)
        pairing, raws = FileEvidence().sort([given])["cam"]
        assert [one.frame.media_type for one in pairing.pairs] == ["image/jpeg"]
        assert raws is None
        assert "capt0000.nef is held back" in held(pairing)
        assert FaultKind.FILE_MISSING in {fault.kind for fault in pairing.faults}


def test_a_raw_file_of_another_body_is_of_another_shot() -> None:
    jpg, nef = picture("1.jpg", NOON, "a"), picture("1.nef", NOON, "b", kind="image/x-nikon-nef")
    theirs = Frame(**{**vars(nef), "metadata": {**nef.metadata, "BodySerialNumber": "2"}})
    ours = Frame(**{**vars(jpg), "metadata": {**jpg.metadata, "BodySerialNumber": "1"}})
    given = FileDelivery("cam", (ours, theirs), shots(1, NOON), 0)
    pairing, raws = FileEvidence().sort([given])["cam"]
    assert raws is None and held(pairing)


def test_a_file_without_a_time_is_no_picture_of_a_camera_that_tells_times() -> None:
    evidence, later = FileEvidence(), NOON + timedelta(seconds=30)
    preview, own = picture("preview.jpg", None, "p"), picture("1.jpg", NOON, "a")
    first = sorted_one(evidence, 1, NOON, preview, own)
    assert [one.frame.metadata["truth"] for one in first.pairs] == ["a"]
    second = sorted_one(evidence, 2, later, picture("preview 2.jpg", None, "q"))
    assert not second.pairs
    assert "it tells no time, and its camera's pictures do" in held(second)


def test_a_burst_is_sorted_by_time_and_not_by_arrival() -> None:
    frames = [
        picture(f"{k}.jpg", NOON + timedelta(seconds=3 * k), str(k + 1), digits=2)
        for k in (2, 0, 1)
    ]
    given = FileDelivery("cam", tuple(frames), shots(1, NOON, 3, 3.0), 0)
    pairing, _ = FileEvidence().sort([given])["cam"]
    assert [one.frame.metadata["truth"] for one in pairing.pairs] == ["1", "2", "3"]
    lacking = FileDelivery("cam", tuple(frames[:2]), shots(1, NOON, 3, 3.0), 0)
    pairing, _ = FileEvidence().sort([lacking])["cam"]
    assert [(o.shot, o.frame.metadata["truth"]) for o in pairing.pairs] == [(1, "1"), (3, "3")]


@dataclass
class TetheredCamera:
    """A camera whose program delivers badly."""

    name: str
    off: timedelta
    digits: int
    timed: bool
    rate: float
    number: int = 0
    on_its_way: list[tuple[int, Frame]] = field(default_factory=list)
    sent: list[Frame] = field(default_factory=list)

    def take(self, truth: str, at: datetime) -> Frame:
        self.number = self.number % 9999 + 1
        drift = timedelta(seconds=(at - NOON).total_seconds() * self.rate)
        own = at + self.off + drift
        name = f"DSC_{self.number:04d}.JPG"
        return picture(name, own if self.timed else None, f"{self.name}/{truth}", self.digits)


def random_offset(lots: random.Random) -> timedelta:
    return timedelta(
        seconds=lots.choice(
            (
                lots.gauss(0.0, 0.4),
                lots.gauss(0.0, 20.0),
                3600.0 * lots.randint(-12, 12) + lots.gauss(0.0, 0.4),
                lots.uniform(-1e8, 0.0),
            )
        )
    )


def set_offset(lots: random.Random) -> timedelta:
    return timedelta(seconds=lots.gauss(0.0, 0.4)) if lots.random() > 0.025 else random_offset(lots)


def arrivals(
    seed: int, captures: int, cameras: int = 9, *, clocks_set: bool = False, wait_s: float = 0.0
) -> Counter[str]:
    """Deliver at random; counts what became of the pictures.

    ``clocks_set``: by the computer's, of all cameras but one in forty. ``wait_s``: how much later
    than told somebody fires at most.
    """
    lots, counts = random.Random(seed), Counter[str]()  # noqa: S311  faults, not secrets
    evidence, at = FileEvidence(), NOON
    rig = [
        TetheredCamera(
            f"cam{k}",
            set_offset(lots) if clocks_set else random_offset(lots),
            lots.choice((0, 2, 3)),
            lots.random() < 0.85,
            lots.gauss(0.0, 2e-5),
            lots.choice((0, 9950)),
        )
        for k in range(cameras)
    ]
    steady = lots.random() < 0.3
    for number in range(captures):
        at += timedelta(seconds=15.0 if steady else lots.uniform(4.0, 90.0))
        taken = at + timedelta(seconds=lots.uniform(0.0, wait_s)) if wait_s else at
        given = [
            FileDelivery(
                camera.name,
                tuple(delivered(lots, camera, rig, number, taken)),
                shots(number, at),
                0,
                round(wait_s * 1e9),
            )
            for camera in rig
        ]
        for name, (pairing, _) in evidence.sort(given).items():
            came = {f.metadata["truth"] for d in given if d.camera == name for f in d.frames}
            for one in pairing.pairs:
                right = one.frame.metadata["truth"] == f"{name}/{number}"
                counts["right" if right else "wrong"] += 1
            if not pairing.pairs:
                counts["held" if f"{name}/{number}" in came else "never came"] += 1
    return counts


def delivered(
    lots: random.Random,
    camera: TetheredCamera,
    rig: list[TetheredCamera],
    number: int,
    at: datetime,
) -> list[Frame]:
    """What a camera's folder gets in one capture."""
    frames = [frame for due, frame in camera.on_its_way if due <= number]
    camera.on_its_way = [(due, frame) for due, frame in camera.on_its_way if due > number]
    lot = lots.random()
    if lot < 0.04 and camera.timed:
        # Taken by hand before the shot, and fetched after it.
        frames.append(camera.take(f"early{number}", at - timedelta(seconds=lots.uniform(3, 40))))
    if lots.random() < 0.005:
        camera.number = 0  # another card
    if lots.random() < 0.01:
        return frames  # it did not fire
    frame = camera.take(str(number), at)
    fate = lots.random()
    if fate < 0.08:
        camera.on_its_way.append((number + lots.choice((1, 1, 1, 2, 5)), frame))
    elif fate > 0.95:
        pass  # never made, or lost
    else:
        frames.append(frame)
        if fate < 0.12:
            frames.append(renamed(frame, f"copy of {frame.metadata['file']}"))
    if 0.1 < lot < 0.13 and camera.sent:
        # An old file copied or renamed: the folder camera has seen its content before.
        old = lots.choice(camera.sent)
        again = renamed(old, f"again {old.metadata['file']}")
        frames.append(Frame(**{**vars(again), "metadata": {**again.metadata, "known_as": "old"}}))
    if 0.13 < lot < 0.15 and frames:
        # A picture of ours lands in another camera's folder as well.
        other = lots.choice(rig)
        other.on_its_way.append((number + (other.name < camera.name), frames[-1]))
    camera.sent += frames
    lots.shuffle(frames)
    return frames


def renamed(frame: Frame, name: str) -> Frame:
    return Frame(**{**vars(frame), "metadata": {**frame.metadata, "file": name}})


@pytest.mark.parametrize("seed", range(12))
def test_no_file_is_given_to_a_wrong_shot(seed: int) -> None:
    """A hundred captures of nine cameras for each seed: 10,800 arrivals, and no wrong picture."""
    counts = arrivals(seed, 100)
    assert counts["wrong"] == 0, counts
    # Even where clocks are off and shots follow at a steady pace, others go on.
    assert counts["right"] > 300, counts


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("wait_s", [0.0, 12.0])
def test_no_file_is_given_to_a_wrong_shot_by_clocks_that_are_set(seed: int, wait_s: float) -> None:
    counts = arrivals(seed, 100, clocks_set=True, wait_s=wait_s)
    assert counts["wrong"] == 0, counts
    assert counts["right"] > 300, counts


def test_files_of_neighbouring_seconds_are_of_two_exposures() -> None:
    at = [NOON + timedelta(seconds=k) for k in range(2)]
    exposures, spare = file_exposures([picture("a.jpg", t, str(k)) for k, t in enumerate(at)], 1)
    assert [e.time for e in exposures] == [file_time(tags(t)) for t in at]
    assert not spare
