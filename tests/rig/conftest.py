"""A small honest network: real cameras about a head, judged by the solver."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from memorybench import BenchMaker

from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.head import synthetic_head
from geometry.preparation import PreparedSubject, SubjectOptions, prepare_subject
from geometry.subject import Subject
from rig.specification.examples import example_rig
from solver.quality import evaluate
from solver.result import Design, SolverReport, StartReport, Status

REPO = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def repo() -> Path:
    return REPO


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[BenchMaker]:
    """Rigs of memory: open, with a session, closed again after the test."""
    maker = BenchMaker(tmp_path)
    yield maker
    maker.close()


@pytest.fixture(scope="session")
def prepared() -> PreparedSubject:
    return prepare_subject(synthetic_head(), SubjectOptions(design_count=200, check_count=1200))


@pytest.fixture(scope="session")
def subject(prepared: PreparedSubject) -> Subject:
    return prepared.subject


def ring(count: int, radius_mm: float, stand_off_mm: float) -> tuple[RigCamera, ...]:
    """Cameras of the face example on a ring in front of the subject."""
    camera = example_rig("face").camera
    cameras = []
    for k in range(count):
        turn = 2.0 * np.pi * k / count
        across, up = radius_mm * np.cos(turn), radius_mm * np.sin(turn)
        back = np.sqrt(stand_off_mm**2 - radius_mm**2)
        pose = Pose.looking_at(np.array([across, -back, up]), np.array([0.0, -60.0, 0.0]))
        focus = float(np.linalg.norm(pose.position_rig_mm - [0.0, -105.0, 0.0]))
        cameras.append(RigCamera(f"cam{k + 1:02d}", camera, pose, focus))
    return tuple(cameras)


def make_design(
    cameras: tuple[RigCamera, ...], start: tuple[RigCamera, ...], subject: Subject
) -> Design:
    limits = example_rig("face").limits
    quality, before = evaluate(subject, cameras, limits), evaluate(subject, start, limits)
    starts = (
        StartReport(0, "k-means", True, quality.cost_mm2, 0.0, 40, 3, "first-order optimum"),
        StartReport(1, "jittered", False, quality.cost_mm2 * 1.2, 0.01, 55, 4, "iteration limit"),
    )
    report = SolverReport(
        "ipopt",
        Status.CONVERGED,
        "first-order optimum within tolerance",
        3.2e-9,
        40,
        3,
        7,
        1.234,
        starts,
    )
    return Design(cameras, quality, start, before, limits, report)


@pytest.fixture(scope="session")
def design(subject: Subject) -> Design:
    return make_design(ring(7, 260.0, 620.0), ring(7, 90.0, 700.0), subject)


@pytest.fixture
def hostile_design(design: Design) -> Design:
    """The same with names that would break a page that does not escape them."""
    evil = "</script><script>document.title='owned'</script><img src=x onerror=alert(1)>"
    cameras = (replace(design.cameras[0], name=evil), *design.cameras[1:])
    row = replace(design.quality.constraints[0], name=f"frame/{evil}")
    quality = replace(design.quality, constraints=(row, *design.quality.constraints[1:]))
    return replace(design, cameras=cameras, quality=quality)
