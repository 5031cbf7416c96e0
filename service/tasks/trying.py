"""Trials: a design and a head in, a verdict with its evidence out."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

from common.errors import InputError
from common.progress import Progress
from evaluation.comparison.comparing import Figures
from evaluation.extras import igl, require_numba
from evaluation.reconstruction.cloudfile import write_cloud, write_distances
from evaluation.report.trialpage import trial_page
from evaluation.trial.trying import Photographer, Trial, by_the_studio, try_rig
from geometry.scanoptions import ScanOptions
from rig.design.designfile import ReadDesign, read_design
from rig.simulation.blender.photographing import BlenderPhotographer
from rig.simulation.settings import HeadSettings, SceneSettings
from service.jobs.engine import Running, Task
from service.kinds.comparison import Share
from service.kinds.trial import RegionPart, TrialRequest, TrialResult
from service.tasks.reconstructing import matching_options

REACH_MM = 0.5
"""At which distance from a point the verdict asks for completeness."""


def trial(task: Task[TrialRequest, TrialResult], running: Running) -> TrialResult:
    """Write ``cloud.ply``, ``distances.ply``, ``truth.ply`` and ``report.html``.

    Inputs: ``design``, ``head``, and where they are pictures of their own ``texture`` and
    ``displacement``.
    """
    require_numba()
    igl()
    request = task.request
    running.report(Progress("reading the design and the head", 0.0))
    design = read_design(task.inputs["design"])
    scene = SceneSettings(head=_head(task, design))
    done = try_rig(
        design.cameras,
        scene,
        exposure=request.exposure,
        radius_mm=request.radius_mm,
        options=matching_options(design, request.stride_px, task.run.workers),
        photographer=_photographer(task),
        progress=running.report,
        cancel=running.cancel,
    )
    running.report(Progress("drawing", 0.95))
    result = _result(done, request, len(design.cameras))
    _write(task.folder, done)
    title = request.name or f"Trial of {design.name}"
    page = trial_page(done, title, result.verdict, _facts(result, task), request.scale_mm)
    (task.folder / "report.html").write_text(page, encoding="utf-8")
    running.report(Progress("done", 1.0))
    return result


def _photographer(task: Task[TrialRequest, TrialResult]) -> Photographer:
    program = task.run.blender
    if program is None:
        return by_the_studio
    return BlenderPhotographer(program, task.request.samples, task.run.workers)


def _head(task: Task[TrialRequest, TrialResult], design: ReadDesign) -> HeadSettings:
    """The head, placed as the design had it."""
    told = ScanOptions() if design.file.rig is None else design.file.rig.to_spec().scan_options
    plain = asdict(ScanOptions())
    unplaced = asdict(replace(told, units="auto", up="auto", front="auto", subject="head"))
    other = [name for name, value in unplaced.items() if value != plain[name]]
    if other:
        raise InputError(
            "trial-scan",
            f"the design places its scan by [scan] {other[0]}, which the simulated studio cannot",
            "save the scan in millimetres and upright, and design for that",
        )
    return HeadSettings(
        scan=task.inputs["head"],
        texture=task.inputs.get("texture"),
        displacement=task.inputs.get("displacement"),
        flip_texture=task.request.flip_texture,
        subdivisions=task.request.subdivisions,
        units=told.units,
        up=told.up,
        front=told.front,
    )


def _write(folder: Path, done: Trial) -> None:
    import trimesh

    write_cloud(folder / "cloud.ply", done.reconstruction.cloud)
    found = done.comparison
    write_distances(folder / "distances.ply", found.points_mm, found.distances_mm)
    mesh = trimesh.Trimesh(done.truth.vertices_mm, done.truth.faces, process=False)
    mesh.export(folder / "truth.ply")


def verdict_on(figures: Figures, request: TrialRequest) -> tuple[bool, str]:
    """Whether a rig with these figures measures the face, and the sentence that says so."""
    reached = dict(figures.reached_percent)[REACH_MM]
    wrong = []
    if figures.rms_mm > request.limit_rms_mm:
        wrong.append(f"its rms of {figures.rms_mm:.3f} mm is above {request.limit_rms_mm:g} mm")
    if reached < request.least_reached_percent:
        wrong.append(
            f"{reached:.1f} % of what two cameras see have a point within {REACH_MM:g} mm, "
            f"less than {request.least_reached_percent:g} %"
        )
    if wrong:
        return False, f"The rig does not measure this face: {', and '.join(wrong)}."
    return True, (
        f"The rig measures this face: rms {figures.rms_mm:.3f} mm, and {reached:.1f} % of what two "
        f"cameras see have a point within {REACH_MM:g} mm."
    )


def _result(done: Trial, request: TrialRequest, cameras: int) -> TrialResult:
    f = done.comparison.figures
    measures, verdict = verdict_on(f, request)
    return TrialResult(
        measures=measures,
        verdict=verdict,
        cameras=cameras,
        points=f.points,
        bias_mm=f.bias_mm,
        rms_mm=f.rms_mm,
        median_absolute_mm=f.median_absolute_mm,
        percentiles_mm=[Share(at=p, value=v) for p, v in f.percentiles_mm],
        reached_percent=[Share(at=r, value=v) for r, v in f.reached_percent],
        seen_percent=done.seen_percent,
        regions=[
            RegionPart(
                region=r.name,
                points=r.points,
                bias_mm=r.bias_mm,
                rms_mm=r.rms_mm,
                predicted_mm=r.predicted_mm,
                measured_mm=r.measured_mm,
                ratio=r.ratio,
            )
            for r in done.regions
        ],
    )


def _facts(result: TrialResult, task: Task[TrialRequest, TrialResult]) -> list[str]:
    request = task.request
    light = "the simulated studio"
    if task.run.blender is not None:
        light = f"Blender, {request.samples} rays a pixel"
    return [
        f"{result.cameras} simulated cameras at their designed places, light by {light}, exposure "
        f"{request.exposure}; judged within {request.radius_mm:g} mm of the nose's tip, of which "
        f"two cameras see {result.seen_percent:.1f} %. Poses and lenses are taken to be known."
    ]
