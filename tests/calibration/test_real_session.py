"""Four webcams and a ChArUco plate, from others' videos: better than the published solution."""

from __future__ import annotations

import pytest

from benchmarks.webcams import run, session_folder


@pytest.mark.slow
def test_the_four_webcam_session_from_nothing() -> None:
    folder = session_folder()
    if folder is None:
        pytest.skip("the four-webcam session is not there")
    came = run(folder)
    quality = came.calibration.quality
    assert quality.converged
    assert came.rms_px <= 1.0
    # What is left out is mostly whole views of cameras that were late.
    assert came.rejected_share <= 0.07
    assert len(quality.late_views) >= 5
    assert len(came.length_errors_mm) > 2000
    assert came.length_share <= 0.004
