"""Files: lossless there and back, strict, one-line errors, never half written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import calibrations
import numpy as np
import pytest

from calibration.acceptance import Acceptance, LengthLimit, MeasuredLength, Outcome, Volume
from calibration.check import check
from calibration.files import (
    ACCEPTANCES,
    CHECKS,
    AcceptanceRecord,
    CalibrationRecord,
    CheckRecord,
    calibration_document,
    calibration_from,
    read_calibration,
    write_calibration,
)
from calibration.files.packing import compact
from common.errors import ConflictError, InputError
from common.files.plain import plain


def record(name: str = "rig") -> CalibrationRecord:
    return CalibrationRecord(name, "2026-11-22T10:00:00Z", calibrations.small_reference())


def document() -> dict[str, Any]:
    return calibration_document(record())


def test_a_calibration_comes_back_bit_for_bit(tmp_path: Path) -> None:
    reference, path = calibrations.small_reference(), tmp_path / "calibration.json"
    write_calibration(path, record())
    read = read_calibration(path)
    assert (read.name, read.made_utc) == ("rig", "2026-11-22T10:00:00Z")
    back = read.calibration
    for a, b in zip(reference.cameras, back.cameras, strict=True):
        assert a.name == b.name
        assert np.array_equal(a.interior.vector, b.interior.vector)
        assert np.array_equal(a.pose.position_rig_mm, b.pose.position_rig_mm)
        assert np.array_equal(a.pose.rotation_rig_to_camera, b.pose.rotation_rig_to_camera)
    assert np.array_equal(reference.target_mm, back.target_mm, equal_nan=True)
    assert np.array_equal(compact(reference.covariance).joint(), back.covariance.joint())
    assert plain(back.quality) == plain(reference.quality)
    assert back.targets.distances == reference.targets.distances
    again = tmp_path / "again.json"
    write_calibration(again, read)
    assert again.read_bytes() == path.read_bytes()


def test_the_smaller_of_two_forms_is_the_same_covariance() -> None:
    covariance = calibrations.small_reference().covariance
    small = compact(covariance)
    scale = np.sqrt(np.diag(covariance.joint())) + 1e-30
    left = (small.joint() - covariance.joint()) / np.outer(scale, scale)
    # One product more or less: rounding of correlations.
    assert np.abs(left).max() < 1e-9
    np.testing.assert_allclose(small.targets(), covariance.targets(), rtol=1e-9, atol=1e-18)


def test_a_check_against_the_file_is_the_check_against_the_calibration(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    write_calibration(path, record())
    observations = calibrations.check_scene().observe(0.1, 5)
    first = check(calibrations.small_reference(), observations)
    second = check(read_calibration(path).calibration, observations)
    assert first.kinds == second.kinds
    assert second.chi2 == pytest.approx(first.chi2, rel=1e-6)


def test_a_check_comes_back(tmp_path: Path) -> None:
    result = check(calibrations.small_reference(), calibrations.check_scene().observe(0.1, 5))
    kept, path = CheckRecord("rig", "2026-11-22T10:00:00Z", result), tmp_path / "check.json"
    CHECKS.write(path, kept)
    back = CHECKS.read(path)
    assert CHECKS.document(back) == CHECKS.document(kept)
    assert back.result.kinds == result.kinds
    assert back.result.cameras[0].sensitivity == result.cameras[0].sensitivity
    with pytest.raises(InputError, match="schema"):
        ACCEPTANCES.read(path)


def test_an_acceptance_comes_back(tmp_path: Path) -> None:
    length = MeasuredLength("bar, frame1", "b0", "b1", 60.0, 60.004, 4.0, 3.0, 23.0)
    result = Acceptance(
        Outcome.INCOMPLETE,
        LengthLimit(20.0, 50.0, 40.0),
        Volume(),
        (length,),
        *(1, 4.0, 4.0, 66.7, 50.0, float("nan")),
        ("one line only",),
        (),
    )
    kept, path = AcceptanceRecord("rig", "", result), tmp_path / "acceptance.json"
    ACCEPTANCES.write(path, kept)
    back = ACCEPTANCES.read(path)
    assert ACCEPTANCES.document(back) == ACCEPTANCES.document(kept)
    assert back.result.lengths == (length,)
    assert back.result.outcome is Outcome.INCOMPLETE


def broken(change: str) -> str:
    data = document()
    if change == "unknown key":
        data["camras"] = data.pop("cameras")
    elif change == "missing key":
        del data["covariance"]
    elif change == "another schema":
        data["schema"] = "rigwright.calibration/2"
    elif change == "wrong type":
        data["cameras"][0]["focal_length_px"] = "long"
    elif change == "infinite":
        return json.dumps(data).replace(repr(data["cameras"][0]["focal_length_px"]), "1e999", 1)
    elif change == "damaged covariance":
        data["covariance"]["core"] = data["covariance"]["core"][:-40]
    elif change == "covariance of others":
        data["covariance"]["kept"] = data["covariance"]["kept"][:-1]
    elif change == "no rotation":
        data["cameras"][1]["rotation_rig_to_camera"][0] = [1.0, 1.0, 1.0]
    elif change == "two of one name":
        data["cameras"][1]["name"] = data["cameras"][0]["name"]
    elif change == "fewer targets":
        data["target_mm"].pop()
    return json.dumps(data)


@pytest.mark.parametrize(
    "change",
    [
        "unknown key",
        "missing key",
        "another schema",
        "wrong type",
        "infinite",
        "damaged covariance",
        "covariance of others",
        "no rotation",
        "two of one name",
        "fewer targets",
    ],
)
def test_a_broken_file_is_one_line(change: str) -> None:
    with pytest.raises(InputError) as caught:
        calibration_from(broken(change), "calibration.json")
    assert "\n" not in str(caught.value)
    assert caught.value.remedy


def test_what_is_not_json_is_said_so() -> None:
    with pytest.raises(InputError, match="not JSON"):
        calibration_from("{", "calibration.json")
    with pytest.raises(InputError, match="not JSON"):
        CHECKS.parse(b"\xff\xfe", "check.json")


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    write_calibration(path, record())
    before = path.read_bytes()
    with pytest.raises(ConflictError, match="exists"):
        write_calibration(path, record())
    assert path.read_bytes() == before
    write_calibration(path, record("other"), overwrite=True)
    assert path.read_bytes() != before
    with pytest.raises(InputError, match="cannot be written"):
        write_calibration(tmp_path / "none" / "c.json", record())
    with pytest.raises(InputError, match="cannot be read"):
        read_calibration(tmp_path / "none.json")
    assert [p.name for p in tmp_path.iterdir()] == ["calibration.json"]
