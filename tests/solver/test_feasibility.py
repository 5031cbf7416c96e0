"""Limits that no rig can hold, told before anything is searched."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rigs import compact_camera, face, face_limits

from geometry.head import synthetic_head
from geometry.preparation import prepare_subject
from geometry.subject import Subject
from rig.specification.examples import example_rig
from solver.design import design
from solver.feasibility.contradictions import hopeless
from solver.limits import (
    BaseHeight,
    Box,
    Frame,
    HalfSpace,
    Incidence,
    Limits,
    Spacing,
    Sphere,
    StandOff,
    Zones,
)
from solver.result import Status


@cache
def subject() -> Subject:
    return face(60, 300)


LIMITS = face_limits()
BEFORE = Box([-400.0, -900.0, -400.0], [400.0, -500.0, 400.0])
COMPACT = compact_camera()
KINDS = {
    # Two cameras are never farther apart than the sum of their distances: seven of them far less.
    "base above what space allows": (COMPACT, {"base_height": BaseHeight(min=1.95)}, "base_height"),
    "base above what a zone allows": (
        COMPACT,
        {"base_height": BaseHeight(min=1.3), "zones": Zones((BEFORE,))},
        "base_height.min",
    ),
    "not sharp so near": (
        compact_camera(f_number=2.0),
        {"stand_off": StandOff(400.0, 800.0)},
        "depth_of_field",
    ),
    # Four fifths of the distance at which all is sharp about the middle would do for 96 % of them.
    "not sharp so near however it aims": (
        compact_camera(f_number=5.6),
        {"stand_off": StandOff(400.0, 800.0)},
        "depth_of_field",
    ),
    "not in frame so near": (
        compact_camera(focal_length_mm=200.0),
        {"stand_off": StandOff(400.0, 700.0), "depth_of_field": False},
        "limits.frame",
    ),
    "pixels too large where it is sharp": (COMPACT, {"gsd_max_mm": 0.045}, "gsd.max_mm"),
    "farther than the space reaches": (
        COMPACT,
        {"stand_off": StandOff(2000.0, 2500.0), "zones": Zones((BEFORE,))},
        "limits.zones leave no place",
    ),
    "zones around everything": (
        COMPACT,
        {"zones": Zones((), (Sphere([0.0, 0.0, 0.0], 4000.0),))},
        "limits.zones leave no place",
    ),
    "only behind the subject": (
        COMPACT,
        {"zones": Zones((HalfSpace([0.0, 1.0, 0.0], 300.0),))},
        "limits.zones",
    ),
    "a zone smaller than the bodies": (
        COMPACT,
        {"zones": Zones((Box([-60.0, -700.0, -40.0], [60.0, -640.0, 40.0]),))},
        "litres",
    ),
    "rays too steep for all": (COMPACT, {"incidence": Incidence(ray_max_deg=20.0)}, "ray_max_deg"),
    "axes too steep": (COMPACT, {"incidence": Incidence(70.0, 8.0)}, "mean_max_deg is 8"),
    "edges longer than the space": (COMPACT, {"spacing": Spacing(4000.0)}, "limits.spacing"),
    "neighbours within each other": (
        COMPACT,
        {"base_height": BaseHeight(neighbour_max=0.015)},
        "neighbour_max",
    ),
    "all within each other": (
        COMPACT,
        {"base_height": BaseHeight(max=0.1), "body_clearance_mm": 130.0},
        "base_height.max is 0.1 at up to 1500 mm",
    ),
    "within each other where pixels are small enough": (
        COMPACT,
        {
            "base_height": BaseHeight(max=0.1),
            "body_clearance_mm": 90.0,
            "gsd_max_mm": 0.1,
        },
        "base_height.max",
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_hopeless_limits_are_told_with_what_to_relax(kind: str) -> None:
    camera, changes, words = KINDS[kind]
    found = hopeless(subject(), camera, replace(LIMITS, **changes), 7)
    assert found is not None
    assert words in found.problem
    assert found.remedy and "\n" not in str(found)


def test_what_can_be_is_not_called_hopeless() -> None:
    reachable = {
        "as it is": (COMPACT, {}, 7),
        "many": (COMPACT, {"base_height": BaseHeight(min=0.1)}, 24),
        "far enough": (compact_camera(f_number=2.0), {"stand_off": StandOff(400.0, 4000.0)}, 7),
        "a zone with room": (COMPACT, {"zones": Zones((BEFORE,))}, 4),
    }
    for kind, (camera, changes, count) in reachable.items():
        assert hopeless(subject(), camera, replace(LIMITS, **changes), count) is None, kind


def test_a_hopeless_design_comes_back_at_once_with_its_sentence() -> None:
    limits = replace(LIMITS, incidence=Incidence(ray_max_deg=20.0))
    began = time.process_time()
    found = design(subject(), COMPACT, limits, count=4, seed=1)
    assert time.process_time() - began < 10.0
    assert found.solver.status is Status.INFEASIBLE and not found.feasible and not found.stands
    assert found.solver.contradiction in found.solver.why_stopped
    assert "ray_max_deg = 20" in (found.solver.contradiction or "")
    # The first network misses base/height too, which has nothing to do with it.
    assert {c.family for c in found.solver.conflicts} == {"coverage_2", "coverage_3"}
    assert len(found.cameras) == 4


@pytest.mark.slow
def test_hopeless_limits_of_a_head_are_told_within_ten_seconds() -> None:
    spec = example_rig("face")
    head = prepare_subject(synthetic_head(), spec.subject_options).subject
    kinds: tuple[Limits, ...] = (
        replace(spec.limits, stand_off=StandOff(500.0, 550.0)),
        replace(spec.limits, frame=Frame(margin_px=1200.0)),
        replace(spec.limits, body_clearance_mm=450.0),
        replace(spec.limits, zones=Zones((Box([-50.0, -770.0, -50.0], [50.0, -700.0, 50.0]),))),
        replace(spec.limits, incidence=Incidence(ray_max_deg=20.0)),
        replace(spec.limits, gsd_max_mm=0.05),
        replace(spec.limits, base_height=BaseHeight(min=1.7)),
    )
    for limits in kinds:
        began = time.process_time()
        found = design(head, spec.camera, limits, count=7, starts=spec.starts)
        assert time.process_time() - began < 10.0
        assert found.solver.contradiction is not None, limits
        assert np.isfinite(found.quality.cost_mm2)
    assert hopeless(head, spec.camera, spec.limits, 4) is None
