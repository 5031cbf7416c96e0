"""Files after a miss: who may be believed again, when, what is said and waited for meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.synchrony.cameraframes import Pairing
from rig.acquisition.synchrony.faults import FaultKind
from rig.acquisition.synchrony.fileclocks import FileDelivery, FiredShot
from rig.acquisition.synchrony.fileevidence import FileEvidence
from rig.acquisition.synchrony.fileoutlook import FileOutlook

NOON = datetime(2026, 11, 29, 12, tzinfo=UTC)
NOON_NS = round(NOON.timestamp() * 1e9)
NAMES = ("left", "middle", "right")


def picture(name: str, at: datetime | None, kind: str = "image/jpeg") -> Frame:
    said = {"file": name, "path": f"/tether/{name}", "sha256": f"{name} {at}"}
    if at is not None:
        said |= {
            "DateTimeOriginal": at.strftime("%Y:%m:%d %H:%M:%S"),
            "OffsetTimeOriginal": "+00:00",
        }
    return Frame("cam", 10**12, FrameStatus.OK, None, b"picture", kind, metadata=said)


class Files:
    """Captures of folder cameras whose files arrive as told."""

    def __init__(self, wait_s: float = 0.0) -> None:
        self.evidence, self.wait_ns, self.number = FileEvidence(), round(wait_s * 1e9), 0

    def capture(
        self,
        at: datetime,
        came: Mapping[str, datetime | None],
        between: Mapping[str, tuple[Frame, ...]] | None = None,
        names: tuple[str, ...] = NAMES,
    ) -> dict[str, Pairing]:
        """Fire at ``at``; each camera of ``came`` brings a picture that tells this time."""
        self.number += 1
        shots = (FiredShot(f"c{self.number}", 1, round(at.timestamp() * 1e9)),)
        given = []
        for name in names:
            frames = (picture(f"{name}-{self.number}.jpg", came[name]),) if name in came else ()
            one = FileDelivery(name, frames, shots, 0, self.wait_ns)
            given.append(replace(one, between=(between or {}).get(name, ())))
        return {name: found[0] for name, found in self.evidence.sort(given).items()}


def filed(found: Mapping[str, Pairing]) -> set[str]:
    return {name for name, pairing in found.items() if pairing.pairs}


def held(pairing: Pairing) -> str:
    return "; ".join(f.text for f in pairing.faults if f.kind is FaultKind.HELD_BACK)


def after(seconds: float) -> datetime:
    return NOON + timedelta(seconds=seconds)


def all_at(at: datetime, *but: str) -> dict[str, datetime | None]:
    return {name: at for name in NAMES if name not in but}


@pytest.mark.parametrize("lacking", [("left",), ("left", "middle"), NAMES])
def test_after_a_miss_clocks_that_are_all_set_are_believed(lacking: tuple[str, ...]) -> None:
    files = Files()
    assert filed(files.capture(NOON, all_at(NOON, *lacking))) == set(NAMES) - set(lacking)
    assert filed(files.capture(after(20), all_at(after(20)))) == set(NAMES)


def test_after_a_miss_none_is_believed_in_a_rig_whose_clocks_are_not_set() -> None:
    files = Files()
    off = {"middle": NOON, "right": after(444)}
    files.capture(NOON, off)
    found = files.capture(after(20), {"left": after(20), "middle": after(20), "right": after(464)})
    assert filed(found) == {"middle", "right"}
    assert "its time fits the shot, but an earlier picture has not come" in held(found["left"])
    assert filed(files.capture(after(50), {"left": after(50)})) == {"left"}


def test_a_late_picture_by_a_clock_off_by_the_pace_is_not_believed_by_one_camera_alone() -> None:
    files = Files()
    files.capture(NOON, {}, names=("left",))
    # Of the first capture: the clock is 20 s ahead.
    assert not filed(files.capture(after(20), {"left": after(20)}, names=("left",)))


def test_how_far_a_time_is_off_is_said_in_words_that_can_be() -> None:
    files = Files(wait_s=2.0)
    files.capture(NOON, {}, names=("left",))
    text = held(files.capture(after(20), {"left": after(20)}, names=("left",))["left"])
    assert "0 s off" not in text
    files = Files()
    files.capture(NOON, all_at(after(500)))
    files.capture(after(30), all_at(after(530)))
    text = held(files.capture(after(60), {"left": after(60)})["left"])
    assert "its time is less than 1 s off the shot, and its clock was +500 s off until now" in text


def test_a_picture_that_came_between_two_captures_is_told_and_no_more_waited_for() -> None:
    files = Files(wait_s=15.0)
    files.capture(NOON, {"left": NOON}, names=("left",))
    files.capture(after(40), {}, names=("left",))
    late = {"left": (picture("left-2.jpg", after(40)),)}
    # Nearer than the deadline: were the one before outstanding, it might be that.
    found = files.capture(after(50), {"left": after(50)}, late, names=("left",))
    assert filed(found) == {"left"}
    assert "left-2.jpg is held back: it came after capture c2 had been written" in held(
        found["left"]
    )


def test_a_clock_is_learned_from_what_came_between() -> None:
    files = Files()
    files.capture(NOON, {}, names=("left",))
    late = {"left": (picture("left-1.jpg", after(-7777)),)}
    found = files.capture(after(31), {"left": after(31 - 7777)}, late, names=("left",))
    assert filed(found) == {"left"}


def test_files_of_before_are_not_told_where_nothing_lacks() -> None:
    files = Files()
    files.capture(NOON, all_at(NOON))
    by_hand = picture("by hand.jpg", after(10))
    own = picture("left-1.jpg", NOON)
    raw = picture("left-1.nef", NOON, "image/x-nikon-nef")
    found = files.capture(after(20), all_at(after(20)), {"left": (by_hand, own, raw)})
    assert filed(found) == set(NAMES)
    assert held(found["left"]).count("held back") == 1
    assert "left-1.nef is held back: it came after capture c1" in held(found["left"])


def test_where_somebody_else_fires_slowly_the_other_cameras_tell_when_it_was() -> None:
    """Shots nearer than the deadline: a missed picture must not cost its camera all others."""
    files, got = Files(wait_s=15.0), []
    for k in range(6):
        at = after(10 * k)
        came = all_at(at + timedelta(seconds=2), *(["left"] if k == 2 else []))
        got.append("left" in filed(files.capture(at, came)))
    assert got == [True, True, False, True, True, True]
    files.capture(after(60), all_at(after(62), "left"))
    late = files.capture(after(70), all_at(after(72)) | {"left": after(62)})
    assert filed(late) == {"middle", "right"}


def test_where_somebody_else_fires_a_picture_by_hand_is_shown_by_the_others() -> None:
    files = Files(wait_s=15.0)
    files.capture(NOON, all_at(after(2)))
    found = files.capture(after(40), all_at(after(52)) | {"left": after(44)})
    assert filed(found) == {"middle", "right"}
    assert "the other cameras' pictures were taken at another time" in held(found["left"])


def test_where_somebody_else_fires_a_clock_is_not_learned_from_a_picture_by_hand() -> None:
    files, off = Files(wait_s=15.0), timedelta(days=-700)
    files.capture(NOON, all_at(after(2), "left") | {"left": after(2) + off})
    late = all_at(after(52), "left") | {"left": after(45) + off}
    assert filed(files.capture(after(40), late)) == {"middle", "right"}


def test_where_somebody_else_fires_a_clock_that_is_set_costs_one_picture() -> None:
    """Also where the shots are nearer than the deadline."""
    files, got = Files(wait_s=15.0), []
    for k in range(7):
        own = after(10 * k + (-3617 if k > 2 else 0))
        found = files.capture(after(10 * k), all_at(after(10 * k), "left") | {"left": own})
        got.append("left" in filed(found))
    assert got == [True, True, True, False, True, True, True]


def test_two_pictures_by_hand_are_no_clock_that_was_set() -> None:
    """Each as long before its shot, and each shot's own picture lost."""
    files = Files()
    assert filed(files.capture(NOON, {"left": NOON}, names=("left",)))
    files.capture(after(40), {}, names=("left",))
    for seconds in (91, 173):
        late = {"left": after(seconds - 30)}
        assert not filed(files.capture(after(seconds), late, names=("left",)))


def test_a_clock_that_drifts_all_day_stays_known() -> None:
    """A gain of 5e-5, 4.3 s a day, is that of a poor camera."""
    files = Files()
    for k in range(600):
        at = after(120.0 * k)
        own = at + timedelta(seconds=777 + 120.0 * k * 5e-5)
        assert filed(files.capture(at, {"left": own}, names=("left",))) or not k, k


def names(outlook: FileOutlook, at: datetime | None, name: str = "a.jpg") -> list[str]:
    return [f.metadata["file"] for f in outlook.likely([picture(name, at)], [NOON_NS])]


@pytest.mark.parametrize(
    ("off_s", "likely"), [(0.0, True), (3600.0, True), (-5.0, False), (444.0, False)]
)
def test_of_an_unknown_clock_what_looks_set_ends_the_wait(off_s: float, likely: bool) -> None:
    fresh = FileOutlook(None, 0, ())
    at = NOON + timedelta(seconds=off_s)
    assert bool(names(fresh, at)) is likely
    assert not names(replace(fresh, outstanding=1), at)


def test_a_file_without_a_time_ends_it_where_nothing_lacks_and_no_clock_is_known() -> None:
    assert names(FileOutlook(None, 0, ()), None)
    assert not names(FileOutlook(None, 1, ()), None)
    assert not names(FileOutlook(None, 0, ("a.jpg None",)), None)


def test_a_clock_that_is_known_decides_also_while_an_earlier_picture_lacks() -> None:
    files = Files()
    files.capture(after(-90), {"left": after(-90 + 2000)}, names=("left",))
    files.capture(after(-60), {"left": after(-60 + 2000)}, names=("left",))
    files.capture(after(-30), {}, names=("left",))
    outlook = files.evidence.outlook("left", 0, NOON_NS)
    assert outlook.outstanding
    assert names(outlook, after(2000))
    assert not names(outlook, NOON)
    assert not names(outlook, after(2000 - 30))


def test_a_raw_file_that_tells_no_time_goes_with_its_picture() -> None:
    files = Files()
    files.capture(after(-30), {"left": after(-30)}, names=("left",))
    pair = [picture("b.jpg", NOON), picture("b.nef", None, "image/x-nikon-nef")]
    outlook = files.evidence.outlook("left", 0, NOON_NS)
    assert len(outlook.likely(pair, [NOON_NS])) == 2
    assert not names(outlook, None)


def test_of_a_camera_that_was_never_seen_nothing_is_known() -> None:
    assert FileEvidence().outlook("left", 7, NOON_NS).offset is None


def hundredths(name: str, at: datetime) -> Frame:
    frame = picture(name, at)
    said = {**frame.metadata, "SubSecTimeOriginal": f"{at.microsecond // 10_000:02d}"}
    return replace(frame, metadata=said)


def test_a_stray_in_the_first_capture_does_not_set_its_camera_s_clock() -> None:
    """Of nine clocks eight agree, and the ninth picture was taken 1.2 s before the shot."""
    evidence = FileEvidence()
    rig = [f"cam{k}" for k in range(9)]

    def capture(number: int, stray_s: float) -> dict[str, Pairing]:
        at = after(30.0 * number)
        shots = (FiredShot(f"c{number}", 1, round(at.timestamp() * 1e9)),)
        times = {name: at + timedelta(seconds=0.03 * (k % 3)) for k, name in enumerate(rig)}
        times["cam4"] += timedelta(seconds=stray_s)
        frames = {name: (hundredths(f"{name}-{number}.jpg", t),) for name, t in times.items()}
        given = [FileDelivery(name, frames[name], shots, 0) for name in rig]
        return {name: found[0] for name, found in evidence.sort(given).items()}

    found = capture(1, -1.2)
    assert filed(found) == set(rig) - {"cam4"}
    assert "its time is -1.2 s off the shot, and the other cameras' agree" in held(found["cam4"])
    assert filed(capture(2, 0.0)) == set(rig)
    # A clock that is off says so twice.
    evidence = FileEvidence()
    assert filed(capture(3, -1.2)) == set(rig) - {"cam4"}
    assert filed(capture(4, -1.2)) == set(rig)
