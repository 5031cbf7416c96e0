"""Calibrations, checks and acceptance tests in short."""

from __future__ import annotations

from calibration.acceptance import Acceptance
from calibration.acceptance.lines import MeasuredLength
from calibration.adjustment import CalibratedCamera, Calibration
from calibration.adjustment.result import CameraQuality
from calibration.check import CheckResult
from calibration.check.verdicts import CameraCheck, Finding
from service.kinds.acceptance import AcceptanceResult, LengthEntry
from service.kinds.calibration import CalibrationResult, CameraCalibration, LateView
from service.kinds.check import CameraVerdict, CheckOutcome, FindingEntry
from service.kinds.detection import Detection


def calibration_result(calibration: Calibration, detection: Detection) -> CalibrationResult:
    """What a calibration is worth, and its cameras."""
    quality = calibration.quality
    cameras = zip(calibration.cameras, quality.cameras, strict=True)
    cross = quality.cross_validation
    return CalibrationResult(
        detection=detection,
        converged=bool(quality.converged),
        why_stopped=quality.stop.value,
        iterations=quality.iterations,
        rms_px=float(quality.rms_px),
        redundancy=quality.dof,
        rejected=quality.rejected,
        late_views=[LateView(camera=v.camera, frame=v.frame) for v in quality.late_views],
        cross_validation=None if cross is None else float(cross.ratio),
        scale=quality.scale,
        datum=calibration.datum,
        warnings=list(quality.warnings),
        doubtful_lenses=list(calibration.doubtful_lenses),
        unfit_lenses=list(quality.unfit_lenses),
        cameras=[_camera(camera, own) for camera, own in cameras],
    )


def _camera(camera: CalibratedCamera, quality: CameraQuality) -> CameraCalibration:
    interior = camera.interior
    return CameraCalibration(
        name=camera.name,
        points=quality.points,
        rejected=quality.rejected,
        rms_px=float(quality.rms_px),
        coverage=float(quality.coverage),
        focal_length_px=float(interior.focal_length_px),
        focal_sigma_px=float(quality.focal_sigma_px),
        principal_point_px=interior.principal_point_px.tolist(),
        principal_point_sigma_px=float(quality.centre_sigma_px),
        distortion=interior.distortion.tolist(),
        position_mm=camera.pose.position_rig_mm.tolist(),
        position_sigma_mm=float(quality.position_sigma_mm),
        rotation_rig_to_camera=camera.pose.rotation_rig_to_camera.tolist(),
        rotation_sigma_deg=float(quality.rotation_sigma_deg),
    )


def check_result(result: CheckResult, detection: Detection) -> CheckOutcome:
    """The verdict of a check, and each camera's."""
    return CheckOutcome(
        detection=detection,
        light=result.light.value,
        text=result.sentence,
        findings=[_finding(finding) for finding in result.findings],
        cameras=[_camera_check(camera, result.power95_factor) for camera in result.cameras],
        scale_ppm=float(result.scale_ppm),
        scale_sigma_ppm=float(result.scale_sigma_ppm),
        rms_px=float(result.rms_px),
        points=result.points,
        outliers=result.outliers,
        notes=list(result.notes),
    )


def _finding(finding: Finding) -> FindingEntry:
    return FindingEntry(
        kind=finding.kind,
        light=finding.light.value,
        subjects=list(finding.subjects),
        text=finding.sentence,
        effect_px=float(finding.effect_px),
        effect_mm=float(finding.effect_mm),
        log10_p=float(finding.log10_p),
    )


def _camera_check(camera: CameraCheck, power: float) -> CameraVerdict:
    seen = camera.sensitivity
    return CameraVerdict(
        name=camera.name,
        verdict=camera.verdict,
        reason=camera.reason,
        points=camera.points,
        rms_px=float(camera.rms_px),
        pose_statistic=float(camera.pose_statistic),
        pose_limit=float(camera.pose_limit),
        lens_statistic=float(camera.lens_statistic),
        lens_limit=float(camera.lens_limit),
        effect_px=float(camera.effect_px),
        effect_mm=float(camera.effect_mm),
        smallest_turn_urad=None if seen is None else [power * float(v) for v in seen.turn_urad],
        smallest_shift_um=None if seen is None else [power * float(v) for v in seen.shift_um],
        hidden_mm=None if seen is None else power * float(seen.hidden_mm),
    )


def acceptance_result(acceptance: Acceptance, detection: Detection) -> AcceptanceResult:
    """The outcome of an acceptance test, and each length."""
    return AcceptanceResult(
        detection=detection,
        outcome=acceptance.outcome.value,
        text=acceptance.sentence,
        lines=acceptance.lines,
        largest_um=float(acceptance.largest_um),
        rms_um=float(acceptance.rms_um),
        scale_ppm=float(acceptance.scale_ppm),
        scale_sigma_ppm=float(acceptance.scale_sigma_ppm),
        missing=list(acceptance.missing),
        notes=list(acceptance.notes),
        lengths=[_length(length) for length in acceptance.lengths],
    )


def _length(length: MeasuredLength) -> LengthEntry:
    return LengthEntry(
        line=length.line,
        first=length.first,
        second=length.second,
        calibrated_mm=float(length.calibrated_mm),
        measured_mm=float(length.measured_mm),
        error_um=float(length.error_um),
        sigma_um=float(length.sigma_um),
        limit_um=float(length.limit_um),
        within=bool(length.within),
    )
