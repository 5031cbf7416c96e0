"""Cameras that fail at their trigger or on the way: the record is true and nothing good is lost."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from memorybench import Bench, BenchMaker
from memoryrig import CameraScript, memory_station, with_policy

from common.errors import InternalError
from rig.acquisition.cameras.base import TimestampKind, TriggerKind
from rig.acquisition.capture.results import CaptureResult
from rig.acquisition.session.recording import make_record
from rig.acquisition.session.records import CaptureRecord, contradictions
from rig.acquisition.session.verify import verify_session
from rig.acquisition.station.spec import Station

SOFTWARE = CameraScript(trigger=TriggerKind.SOFTWARE)
DUMB = replace(SOFTWARE, timestamps=TimestampKind.NONE)


def told_over_their_bus(cameras: int = 3) -> Station:
    # Commands one after another: how far apart they come is not what is tested here.
    station = with_policy(
        memory_station(cameras), frame_deadline_s=0.3, settle_s=0.02, skew_limit_us=1e7
    )
    freed = tuple(replace(camera, output=None) for camera in station.cameras)
    return replace(station, cameras=freed, trigger=None)


def taken(bench: BenchMaker, bad: CameraScript, good: CameraScript, shots: int) -> CaptureResult:
    made = bench(told_over_their_bus(), {"cam01": good, "cam02": bad, "cam03": good})
    result = made.rig.capture(made.session, "one", shots=shots, interval_us=60_000.0)
    check_truth(made, result.record)
    return result


def check_truth(made: Bench, record: CaptureRecord) -> None:
    """No picture under a wrong shot, no contradiction, every other camera's pictures there."""
    assert verify_session(made.session.folder).whole
    assert contradictions(record) == []
    for frame in record.frames:
        assert frame.metadata["truth"].endswith(f"/{frame.shot}")
    for name in ("cam01", "cam03"):
        assert name not in record.missing
    assert {fault.camera for fault in record.faults if fault.kind == "missing"} <= {"cam02"}


@pytest.mark.parametrize("kind", [SOFTWARE, DUMB], ids=["stamps", "no stamps"])
def test_a_camera_that_fails_at_its_trigger_is_missing_and_named(
    bench: BenchMaker, kind: CameraScript
) -> None:
    result = taken(bench, replace(kind, refuses=frozenset({1})), kind, 1)
    assert result.record.state == "partial"
    assert result.record.missing == {"cam02": [1]}
    assert result.record.verdict.state == "unproven"
    assert "1 of 3 cameras lack" in result.record.verdict.text or kind is DUMB
    assert result.error is not None
    assert "cam02: " in str(result.error)
    assert "(it could not focus)" in str(result.error)
    assert "order of arrival" not in str(result.error)


@pytest.mark.parametrize("kind", [SOFTWARE, DUMB], ids=["stamps", "no stamps"])
def test_what_a_camera_gave_before_and_after_a_failed_shot_is_kept(
    bench: BenchMaker, kind: CameraScript
) -> None:
    record = taken(bench, replace(kind, refuses=frozenset({2})), kind, 3).record
    assert record.missing == {"cam02": [2]}
    assert record.verdict.state == "unproven"


@pytest.mark.parametrize("kind", [SOFTWARE, DUMB], ids=["stamps", "no stamps"])
def test_a_shot_that_was_made_although_its_command_failed_is_kept(
    bench: BenchMaker, kind: CameraScript
) -> None:
    record = taken(bench, replace(kind, refuses_after=frozenset({2})), kind, 3).record
    assert record.missing == {}
    assert record.state == "complete"


@pytest.mark.parametrize("kind", [SOFTWARE, DUMB], ids=["stamps", "no stamps"])
def test_a_camera_that_dies_in_a_burst_keeps_its_earlier_shots(
    bench: BenchMaker, kind: CameraScript
) -> None:
    record = taken(bench, replace(kind, dies_at=3), kind, 4).record
    assert record.missing == {"cam02": [3, 4]}
    assert any("its process ended" in fault.text for fault in record.faults)


def test_a_camera_that_hangs_in_a_burst_keeps_its_earlier_shots(
    bench: BenchMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.acquisition.capture.run.BOX_MARGIN_S", 0.3)
    record = taken(bench, replace(DUMB, hangs_at=3), DUMB, 3).record
    # Of two pictures and three commands nobody can tell which were carried out; of two
    # commands that are known, both.
    assert record.missing in ({"cam02": [3]}, {"cam02": [1, 2, 3]})
    assert any("did not answer" in fault.text for fault in record.faults)


def test_a_frame_of_which_everything_was_lost_costs_its_camera_only(bench: BenchMaker) -> None:
    station = with_policy(memory_station(), frame_deadline_s=0.2, settle_s=0.02)
    made = bench(station, {"cam02": CameraScript(empty=frozenset({2}))})
    result = made.rig.capture(made.session, "one", shots=3, interval_us=40_000.0)
    assert result.record.missing == {"cam02": [2]}
    assert "the picture of shot 2 was lost on its way" in str(result.error)
    check_truth(made, result.record)


def test_a_picture_that_nothing_can_code_costs_its_camera_only(
    bench: BenchMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rig.acquisition.session import staging

    usual = staging.filed

    def fails(frame, facts, policy):  # noqa: ANN001, ANN202
        if facts.unique_id == "one/cam02/1":
            raise ValueError("no such mode")
        return usual(frame, facts, policy)

    monkeypatch.setattr(staging, "filed", fails)
    made = bench()
    record = made.rig.capture(made.session, "one").record
    assert record.missing == {"cam02": [1]}
    assert record.state == "partial"
    check_truth(made, record)


def test_a_record_that_contradicts_itself_cannot_be_made(
    bench: BenchMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rig.acquisition.session import staging

    def forgets(captured, evidence, files, numbering, **more):  # noqa: ANN001, ANN003, ANN202
        return make_record(captured, evidence, files[1:], numbering, **more)

    monkeypatch.setattr(staging, "make_record", forgets)
    made = bench()
    with pytest.raises(InternalError, match="nothing says so"):
        made.rig.capture(made.session, "one")
    assert [entry.capture_id for entry in made.session.manifest.interrupted] == ["one"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [SOFTWARE, DUMB], ids=["stamps", "no stamps"])
def test_random_failures_never_make_a_record_untrue(bench: BenchMaker, kind: CameraScript) -> None:
    for seed in range(60):
        lots = random.Random(seed)  # noqa: S311  faults, not secrets
        shots = lots.randint(1, 4)

        def some(lots: random.Random = lots, shots: int = shots) -> frozenset[int]:
            return frozenset(s for s in range(1, shots + 1) if lots.random() < 0.25)

        bad = replace(
            kind,
            refuses=some(),
            refuses_after=some(),
            empty=some(),
            dies_at=lots.choice((None, None, lots.randint(1, shots))),
        )
        taken(bench, bad, kind, shots)
        bench.close()
        bench.made.clear()
