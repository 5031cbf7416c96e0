"""Comparisons: a cloud and a reference in, distances and a page out."""

from __future__ import annotations

import numpy as np

from common.progress import Progress
from evaluation.comparison.comparing import Comparison, Within, compare
from evaluation.comparison.referencefile import read_reference
from evaluation.reconstruction.cloudfile import read_points, write_distances
from evaluation.report.pages import comparison_page
from service.jobs.engine import Running, Task
from service.kinds.comparison import ComparisonRequest, ComparisonResult, Share


def comparison(
    task: Task[ComparisonRequest, ComparisonResult], running: Running
) -> ComparisonResult:
    """Write ``distances.ply`` and ``report.html`` for the inputs ``cloud`` and ``reference``."""
    request = task.request
    running.report(Progress("reading", 0.0))
    points = read_points(task.inputs["cloud"])
    reference = read_reference(task.inputs["reference"])
    running.report(Progress("comparing", 0.1))
    ball = request.within
    within = None if ball is None else Within(ball.centre_mm, ball.radius_mm)
    done = compare(points, reference, align=request.align, within=within, limit_mm=request.limit_mm)
    running.report(Progress("drawing", 0.9))
    write_distances(task.folder / "distances.ply", done.points_mm, done.distances_mm)
    title = f"{task.inputs['cloud'].name} against {task.inputs['reference'].name}"
    page = comparison_page(done, title, request.scale_mm)
    (task.folder / "report.html").write_text(page, encoding="utf-8")
    running.report(Progress("done", 1.0))
    return _result(done, request)


def _result(done: Comparison, request: ComparisonRequest) -> ComparisonResult:
    f = done.figures
    return ComparisonResult(
        points=f.points,
        left_out=f.left_out,
        bias_mm=f.bias_mm,
        rms_mm=f.rms_mm,
        median_absolute_mm=f.median_absolute_mm,
        mad_mm=f.mad_mm,
        percentiles_mm=[Share(at=p, value=v) for p, v in f.percentiles_mm],
        reached_percent=[Share(at=r, value=v) for r, v in f.reached_percent],
        points_per_mm2=float(np.round(f.points_per_mm2, 4)),
        align=request.align,
        scale=done.alignment.scale,
        converged=done.alignment.converged,
    )
