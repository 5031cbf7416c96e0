"""Calibrations, checks and acceptance tests in short, as JSON data."""

from __future__ import annotations

from typing import Any

from calibration.acceptance import Acceptance
from calibration.adjustment import CalibratedCamera, Calibration
from calibration.adjustment.result import CameraQuality
from calibration.check import CheckResult
from calibration.check.verdicts import CameraCheck, Finding
from common.files.plain import plain

JSON = dict[str, Any]


def calibration_figures(calibration: Calibration) -> JSON:
    """What a calibration is worth, and its cameras."""
    quality = calibration.quality
    cameras = zip(calibration.cameras, quality.cameras, strict=True)
    cross = quality.cross_validation
    figures: JSON = plain(
        {
            "converged": quality.converged,
            "why_stopped": quality.stop.value,
            "iterations": quality.iterations,
            "rms_px": quality.rms_px,
            "redundancy": quality.dof,
            "rejected": quality.rejected,
            "late_views": [{"camera": v.camera, "frame": v.frame} for v in quality.late_views],
            "cross_validation": None if cross is None else cross.ratio,
            "scale": quality.scale,
            "datum": calibration.datum,
            "warnings": quality.warnings,
            "cameras": [_camera(camera, own) for camera, own in cameras],
        }
    )
    return figures


def _camera(camera: CalibratedCamera, quality: CameraQuality) -> JSON:
    interior = camera.interior
    return {
        "name": camera.name,
        "points": quality.points,
        "rejected": quality.rejected,
        "rms_px": quality.rms_px,
        "coverage": quality.coverage,
        "focal_length_px": interior.focal_length_px,
        "focal_sigma_px": quality.focal_sigma_px,
        "principal_point_px": interior.principal_point_px,
        "principal_point_sigma_px": quality.centre_sigma_px,
        "distortion": interior.distortion,
        "position_mm": camera.pose.position_rig_mm,
        "position_sigma_mm": quality.position_sigma_mm,
        "rotation_rig_to_camera": camera.pose.rotation_rig_to_camera,
        "rotation_sigma_deg": quality.rotation_sigma_deg,
    }


def check_figures(result: CheckResult) -> JSON:
    """The verdict of a check, and each camera's."""
    figures: JSON = plain(
        {
            "light": result.light.value,
            "text": result.sentence,
            "findings": [finding_figures(finding) for finding in result.findings],
            "cameras": [_camera_check(camera, result.power95_factor) for camera in result.cameras],
            "scale_ppm": result.scale_ppm,
            "scale_sigma_ppm": result.scale_sigma_ppm,
            "rms_px": result.rms_px,
            "points": result.points,
            "outliers": result.outliers,
            "notes": result.notes,
        }
    )
    return figures


def finding_figures(finding: Finding) -> JSON:
    """One finding."""
    return {
        "kind": finding.kind.value,
        "light": finding.light.value,
        "subjects": finding.subjects,
        "text": finding.sentence,
        "effect_px": finding.effect_px,
        "effect_mm": finding.effect_mm,
        "log10_p": finding.log10_p,
    }


def _camera_check(camera: CameraCheck, power: float) -> JSON:
    seen = camera.sensitivity
    return {
        "name": camera.name,
        "verdict": camera.verdict.value,
        "reason": camera.reason,
        "points": camera.points,
        "rms_px": camera.rms_px,
        "pose_statistic": camera.pose_statistic,
        "pose_limit": camera.pose_limit,
        "lens_statistic": camera.lens_statistic,
        "lens_limit": camera.lens_limit,
        "effect_px": camera.effect_px,
        "effect_mm": camera.effect_mm,
        "smallest_turn_urad": None if seen is None else [power * v for v in seen.turn_urad],
        "smallest_shift_um": None if seen is None else [power * v for v in seen.shift_um],
        "hidden_mm": None if seen is None else power * seen.hidden_mm,
    }


def acceptance_figures(acceptance: Acceptance) -> JSON:
    """The outcome of an acceptance test, and each length."""
    figures: JSON = plain(
        {
            "outcome": acceptance.outcome.value,
            "text": acceptance.sentence,
            "lines": acceptance.lines,
            "largest_um": acceptance.largest_um,
            "rms_um": acceptance.rms_um,
            "scale_ppm": acceptance.scale_ppm,
            "scale_sigma_ppm": acceptance.scale_sigma_ppm,
            "missing": acceptance.missing,
            "notes": acceptance.notes,
            "lengths": [{**plain(m), "within": m.within} for m in acceptance.lengths],
        }
    )
    return figures
