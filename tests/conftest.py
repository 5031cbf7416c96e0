"""What all tests share: real data when it is there, and no skips that should not be."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest
from hypothesis import settings

from common.threads import ONE_BLAS_THREAD

ROOT = Path(__file__).resolve().parents[1]
ALLOW_NO_SKIP = "TESTS_ALLOW_NO_SKIP"
PROVIDED = (
    "needs_browser", "needs_avr", "needs_aravis", "needs_genicam", "needs_gphoto2",
    "needs_cloudcompare", "needs_slicer",
)  # fmt: skip
"""Marks of tests whose needs .ci/packages.txt or the development extras provide."""

_wrongly_skipped: list[str] = []

# As commands and jobs have it; read when the libraries are loaded, which is after this.
for _name, _count in ONE_BLAS_THREAD.items():
    os.environ.setdefault(_name, _count)


# How long one example takes is the machine's affair; a test that hangs is ended by its timeout.
settings.register_profile("without a deadline", deadline=None)
settings.load_profile("without a deadline")


@pytest.hookimpl(hookwrapper=True)
def pytest_collection():  # noqa: ANN201
    """Half a million objects of modules and tests stay to the end: nobody looks through them again.

    A tenth of the processor time of a run went to looking.
    """
    gc.disable()
    yield
    gc.enable()
    gc.freeze()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]):  # noqa: ANN201, ARG001
    outcome = yield
    report = outcome.get_result()
    if (
        report.skipped
        and os.environ.get(ALLOW_NO_SKIP)
        and any(map(item.get_closest_marker, PROVIDED))
    ):
        _wrongly_skipped.append(item.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    if _wrongly_skipped and session.exitstatus == 0:
        session.exitstatus = 1


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if _wrongly_skipped:
        terminalreporter.section("skipped although .ci/packages.txt provides what they need")
        for name in _wrongly_skipped:
            terminalreporter.line(name)
