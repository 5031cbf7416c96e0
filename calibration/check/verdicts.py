"""What a check can say. Names are stable: files, programs and people rely on them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from calibration.adjustment.residualgrid import GridCell


class Kind(StrEnum):
    """Kinds of findings."""

    FINE = "fine"
    CAMERA_MISSING = "camera-missing"
    BLURRED = "blurred"
    TARGETS_LOST = "targets-lost"
    CAMERA_MOVED = "camera-moved"
    LENS_CHANGED = "lens-changed"
    TARGET_MOVED = "target-moved"
    CARRIER_BENT = "carrier-bent"
    PRINT_SCALE = "print-scale"
    SCALE_CHANGED = "scale-changed"
    IDS_SWAPPED = "ids-swapped"
    CAMERAS_SWAPPED = "cameras-swapped"
    UNSYNCHRONISED = "unsynchronised"
    NOISE_RAISED = "noise-raised"
    UNEXPLAINED = "unexplained"
    CANNOT_TELL = "cannot-tell"

    @property
    def words(self) -> str:
        """The kind as people read it."""
        return self.value.replace("-", " ")


class Light(StrEnum):
    """The whole check in one word: go on, look, or stop."""

    GREEN = "green"
    YELLOW = "yellow"
    RED = "red"


STOPPING = frozenset(
    {
        Kind.CAMERA_MISSING,
        Kind.BLURRED,
        Kind.CAMERA_MOVED,
        Kind.LENS_CHANGED,
        Kind.SCALE_CHANGED,
        Kind.CAMERAS_SWAPPED,
        Kind.UNSYNCHRONISED,
        Kind.UNEXPLAINED,
    }
)
"""What spoils pictures taken with the old calibration; the other kinds are about the targets."""


@dataclass(frozen=True)
class Finding:
    """One thing that a check found, in one plain sentence and in numbers.

    ``subjects``: names of the cameras, carriers or targets it is about. ``candidates``: others
    that would explain the images almost as well. ``statistic`` is chi-square distributed with
    ``dof`` when nothing happened, ``log10_p`` the decimal logarithm of the chance to exceed it
    then. ``effect_px``: root mean square shift of image points; ``effect_mm``: of points at the
    subject when the old calibration goes on being used; both NaN where they mean nothing.
    ``value`` is the finding's own number (a scale, a factor of noise), ``sigma`` its sigma.
    ``tolerable``: sure, but so small that the old calibration still serves. ``state``: in two words
    why the camera was not checked, where the kind alone does not say it.
    """

    kind: Kind
    subjects: tuple[str, ...]
    sentence: str
    statistic: float = float("nan")
    dof: int = 0
    log10_p: float = float("nan")
    effect_px: float = float("nan")
    effect_mm: float = float("nan")
    value: float = float("nan")
    sigma: float = float("nan")
    candidates: tuple[str, ...] = ()
    tolerable: bool = False
    state: str = ""

    @property
    def light(self) -> Light:
        """What the finding means for the whole."""
        if self.kind is Kind.FINE:
            return Light.GREEN
        return Light.RED if self.kind in STOPPING and not self.tolerable else Light.YELLOW


@dataclass(frozen=True)
class Sensitivity:
    """The smallest movement of one camera that its test could have seen.

    Each direction for itself, after Baarda: delta0 = 4.13, false alarms 0.1 %, power 80 %.
    ``turn_urad`` about the camera's x, y and viewing axis; ``shift_um`` along them. ``hidden_mm``
    and ``hidden_px``: the largest effect at the subject of any movement below that bound.
    """

    turn_urad: tuple[float, float, float]
    shift_um: tuple[float, float, float]
    hidden_mm: float
    hidden_px: float


@dataclass(frozen=True)
class CameraCheck:
    """One camera: its tests, its residuals, and what the tests could have seen.

    ``pose_statistic`` (6 dof) and ``lens_statistic`` (f, cx, cy: 3 dof) before anything was found
    and accounted for, with ``*_limit`` from where they alarm. ``effect_px``, ``effect_mm`` of what
    was found of the camera, as its finding has them (``effect_mm`` of all cameras that share it);
    else of the likeliest movement. ``verdict``: fine, camera-moved, lens-changed or cannot-tell,
    and ``reason`` for the last. ``grid``: residuals over the image.
    """

    name: str
    points: int
    rms_px: float
    robust_sigma_px: float
    bias_px: tuple[float, float]
    noise_factor: float
    pose_statistic: float
    pose_limit: float
    pose_log10_p: float
    lens_statistic: float
    lens_limit: float
    lens_log10_p: float
    effect_px: float
    effect_mm: float
    sensitivity: Sensitivity | None
    verdict: Kind
    reason: str
    grid: tuple[GridCell, ...]


@dataclass(frozen=True)
class CarrierCheck:
    """One carrier: its shape test, its size against the reference, its worst target.

    ``shift_mm``: how far a standing one stands from where it stood before the same cameras, which
    is harmless; NaN for carriers that are moved about. ``scale_ppm``
    and ``scale_sigma_ppm``: how much larger it is than in the reference. ``worst_target`` has the
    largest of the per-target tests (3 dof).
    """

    name: str
    points: int
    rms_px: float
    shift_mm: float
    shape_statistic: float
    shape_dof: int
    shape_log10_p: float
    scale_ppm: float
    scale_sigma_ppm: float
    worst_target: str
    worst_statistic: float
    verdict: Kind


@dataclass(frozen=True)
class LengthCheck:
    """A measured distance against what the cameras of the reference now say of it."""

    first: str
    second: str
    length_mm: float
    error_um: float
    sigma_um: float

    @property
    def z(self) -> float:
        """Error over sigma."""
        return self.error_um / self.sigma_um


@dataclass(frozen=True)
class CheckResult:
    """A whole check. ``findings`` has at least one; the first is the most important.

    ``chi2`` over ``dof`` of all residuals before anything was accounted for. ``scale_ppm``: how
    much larger everything measures than in the reference. ``power95_factor``: a movement of this
    many times a camera's sensitivity is reported in 95 % of checks. ``outliers``: image points
    left out as blunders. ``notes`` are sentences that raise no alarm.
    """

    light: Light
    findings: tuple[Finding, ...]
    cameras: tuple[CameraCheck, ...]
    carriers: tuple[CarrierCheck, ...]
    lengths: tuple[LengthCheck, ...]
    chi2: float
    dof: int
    rms_px: float
    scale_ppm: float
    scale_sigma_ppm: float
    power95_factor: float
    alpha: float
    points: int
    frames: int
    outliers: int
    notes: tuple[str, ...]

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Kinds of all findings, in their order."""
        return tuple(f.kind for f in self.findings)

    @property
    def sentence(self) -> str:
        """The findings as plain sentences."""
        return " ".join(f.sentence for f in self.findings)
