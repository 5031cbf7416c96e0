"""Tables of measurements in a terminal of 80 columns: nothing is broken or cut."""

from __future__ import annotations

import pytest

from service.cli.tables.measurement_tables import print_acceptance
from service.kinds.acceptance import AcceptanceResult, LengthEntry
from service.kinds.detection import Detection


def entry(line: str, last: str) -> LengthEntry:
    return LengthEntry(
        line=line,
        first="ring12-021",
        second=last,
        calibrated_mm=240.0,
        measured_mm=240.1,
        error_um=-100.0,
        sigma_um=3.0,
        limit_um=32.0,
        within=False,
    )


def test_the_lengths_of_an_acceptance_test_fit_80_columns(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = [f"bar in cap-20261129T20200{k}-96c33b-1" for k in range(2)]
    result = AcceptanceResult(
        detection=Detection(pictures=8, frames=2, targets=12, cameras=[], rejected=[]),
        outcome="failed",
        text="Failed.",
        lines=2,
        largest_um=100.0,
        rms_um=100.0,
        scale_ppm=1.0,
        scale_sigma_ppm=1.0,
        missing=[],
        notes=[],
        lengths=[entry(line, f"ring12-02{k}") for line in lines for k in (5, 6)],
    )
    print_acceptance(result)
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines())) <= 80
    for k, line in enumerate(lines, 1):
        assert f"line {k}: {line}\n" in told
    rows = [row for row in told.splitlines() if "ring12" in row]
    assert len(rows) == 4
    assert all("ring12-021 - ring12-02" in row and "BEYOND" in row for row in rows)
