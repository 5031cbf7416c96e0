"""The work of one unit: prepare the heads, design for one, score on all."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from common.errors import CancelledError, RigwrightError
from common.progress import CancelToken
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.head import random_head_shape, synthetic_head
from geometry.preparation import prepare_subject
from geometry.raycast import Occluder
from geometry.reading import read_scan
from geometry.scan import Scan
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from rig.solids.bodies import place_body
from rig.specification.sections.subject import ScanSection, SubjectSection
from rig.specification.solving import solved
from rig.study.unit import HeadFigures, Place, Unit, UnitResult
from solver.quality import evaluate
from solver.result import Quality

KEPT = 16
"""Heads that a worker keeps ready: about 5 MB each."""


def solve_unit(unit: Unit, files: Mapping[str, Path], cancel: CancelToken) -> UnitResult:
    """The result of a unit, the same bits wherever it is computed.

    ``files`` holds the scans by their hash. What is wrong with the unit becomes its reason;
    raises :class:`CancelledError` only.
    """
    try:
        with threadpool_limits(1):
            return _solved(unit, files, cancel)
    except CancelledError:
        raise
    except RigwrightError as error:
        return UnitResult(key=unit.key(), reason=str(error), designed_for=unit.designed_for)


def fault_of(unit: Unit, error: Exception) -> UnitResult:
    """The row of a unit that met a fault of the program."""
    told = traceback.format_exception_only(error)[-1].strip()
    return UnitResult(
        key=unit.key(), reason=f"fault: {told}; report this fault", designed_for=unit.designed_for
    )


def _solved(unit: Unit, files: Mapping[str, Path], cancel: CancelToken) -> UnitResult:
    spec = unit.rig.to_spec()
    subjects = _seated(unit, files)
    own = subjects[unit.designed_for]
    made = solved(own, spec, cancel=cancel)
    cameras, quality = made.cameras, made.quality
    scored = [
        quality if subject is own else evaluate(subject, cameras, spec.limits)
        for subject in subjects
    ]
    figures = [_figures(h.name, q) for h, q in zip(unit.heads, scored, strict=True)]
    broken = figures[unit.designed_for].violated
    return UnitResult(
        key=unit.key(),
        reason=f"the limits cannot all be met ({', '.join(broken)})" if broken else "",
        heads=figures,
        designed_for=unit.designed_for,
        centre_mm=own.design_points.centroid_mm.tolist(),
        places=[_place(camera) for camera in cameras],
        size_mm=array_size_mm(cameras).tolist(),
    )


def _seated(unit: Unit, files: Mapping[str, Path]) -> list[Subject]:
    """All heads, each where the first one is: files have their origins anywhere."""
    options = (unit.rig.scan.model_dump_json(), unit.rig.subject.model_dump_json())
    subjects = [_subject(h.seed, files.get(h.sha256 or ""), *options, unit.rig.seed)
                for h in unit.heads]  # fmt: skip
    first = subjects[0].design_points.centroid_mm
    moves = [first - s.design_points.centroid_mm for s in subjects]
    return [subjects[0]] + [_moved(s, m) for s, m in zip(subjects[1:], moves[1:], strict=True)]


@lru_cache(maxsize=KEPT)
def _subject(
    seed: int | None, path: Path | None, scan_json: str, subject_json: str, sampling_seed: int
) -> Subject:
    section = SubjectSection.model_validate_json(subject_json)
    return prepare_subject(_scan(seed, path, scan_json), section.to_options(sampling_seed)).subject


@lru_cache(maxsize=KEPT)
def _scan(seed: int | None, path: Path | None, scan_json: str) -> Scan:
    if path is not None:
        return read_scan(path, ScanSection.model_validate_json(scan_json).to_options())
    return synthetic_head() if seed is None else synthetic_head(random_head_shape(seed), seed)


def _moved(subject: Subject, by_mm: Floats) -> Subject:
    def points(those: SurfacePoints) -> SurfacePoints:
        return SurfacePoints(those.points_mm + by_mm, those.normals)

    occluder = subject.occluder
    solid = Occluder(occluder.vertices_mm + by_mm, occluder.faces, occluder.lift_mm)
    return Subject(points(subject.design_points), points(subject.check_points), solid)


def _figures(head: str, quality: Quality) -> HeadFigures:
    share = {row.views: float(row.share) for row in quality.coverage}
    return HeadFigures(
        head=head,
        violated=list(dict.fromkeys(row.family for row in quality.violated)),
        cost_mm2=float(quality.cost_mm2),
        sigma_median_mm=float(quality.sigma_median_mm),
        sigma_p95_mm=float(quality.sigma_p95_mm),
        sigma_max_mm=float(quality.sigma_max_mm),
        seen_twice_share=share.get(2, 0.0),
        seen_thrice_share=share.get(3, 0.0),
        in_frame_share=float(quality.in_frame_share),
        in_focus_share=float(quality.in_focus_share),
    )


def _place(camera: RigCamera) -> Place:
    pose = camera.pose
    return Place(
        name=camera.name,
        position_mm=pose.position_rig_mm.tolist(),
        looks_along=pose.rotation_rig_to_camera[2].tolist(),
    )


def array_size_mm(cameras: tuple[RigCamera, ...]) -> Floats:
    """Extent of all bodies along the axes of the rig frame, (3,)."""
    corners = np.concatenate([part for c in cameras for part in place_body(c).parts])
    return np.asarray(corners.max(axis=0) - corners.min(axis=0))
