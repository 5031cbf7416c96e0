"""What stands in a design file: its pydantic models, nothing else.

``docs/reference/design.schema.json`` is generated from them and
``docs/reference/design-file.md`` explains it.
Numbers that have no value (a far limit of sharpness at infinity, the figures of a camera that
sees nothing) are null: JSON knows neither NaN nor infinity.
"""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Len
from pydantic import Field

from common.files.strict import CameraName, Matrix, StrictModel, Vector
from rig.specification.rigfile import RigFile
from rig.specification.sections.camera import BodySection

Covariance = Annotated[list[float], Len(6, 6)]
Number = float | None


class LensFacts(StrictModel):
    """What a camera matrix does not say about a camera."""

    kind: str = Field(description="Name of the kind of camera.")
    pixel_pitch_mm: float = Field(gt=0.0, description="Distance of neighbouring pixels.")
    focal_length_mm: float = Field(gt=0.0, description="Focal length (principal distance).")
    f_number: float = Field(gt=0.0, description="Aperture.")
    circle_of_confusion_mm: float = Field(gt=0.0, description="Largest blur that counts as sharp.")
    min_focus_mm: float = Field(gt=0.0, description="Nearest focus setting.")
    set_focus_mm: float | None = Field(
        default=None, gt=0.0, description="Focus setting that was given."
    )


class PlacedCamera(StrictModel):
    """One camera of the rig: where it stands and what it is."""

    name: CameraName = Field(description="Name of the camera.")
    position_mm: Vector = Field(description="Projection centre in the rig frame.")
    rotation_rig_to_camera: Matrix | None = Field(
        default=None, description="Rows are the camera's x, y and z axes in the rig frame."
    )
    omega_phi_kappa_deg: Vector | None = Field(default=None, description="The same as angles.")
    image_size_px: Annotated[list[Annotated[int, Field(ge=2, le=100_000)]], Len(2, 2)] = Field(
        description="Width and height of the image."
    )
    camera_matrix: Matrix = Field(description="OpenCV camera matrix, pixel centres at integers.")
    distortion: Annotated[list[float], Len(4, 8)] = Field(
        description="Brown-Conrady k1, k2, p1, p2, k3; eight terms rational, four a fisheye."
    )
    focus_distance_mm: float | None = Field(default=None, gt=0.0, description="Focus setting.")
    fixed: bool = Field(
        default=False, description="Whether the design had to leave it where it is."
    )
    lens: LensFacts | None = Field(default=None, description="Lens and sensor.")
    body: BodySection | None = Field(default=None, description="The solid it occupies.")


class ShareOfViews(StrictModel):
    """Share of points with so many views or more."""

    views: int = Field(description="Number of views.")
    share: float = Field(description="Share of the points, 0 to 1.")


class CameraFigures(StrictModel):
    """What one camera sees and how."""

    name: str = Field(description="Name of the camera.")
    points_seen: int = Field(description="Number of points seen.")
    gsd_min_mm: Number = Field(description="Smallest ground sample distance.")
    gsd_mean_mm: Number = Field(description="Mean ground sample distance.")
    gsd_max_mm: Number = Field(description="Largest ground sample distance.")
    incidence_mean_deg: Number = Field(description="Mean angle between ray and normal.")
    incidence_max_deg: Number = Field(description="Largest angle between ray and normal.")
    depth_min_mm: Number = Field(description="Depth of the nearest seen point.")
    depth_max_mm: Number = Field(description="Depth of the farthest seen point.")
    sharp_from_mm: Number = Field(description="Near limit of the depth of field.")
    sharp_to_mm: Number = Field(description="Far limit of the depth of field; null: infinity.")
    distance_mm: Number = Field(description="Distance to the object's centroid.")
    nearest_body_mm: Number = Field(description="Gap to the next body; null: none.")
    roll_deg: Number = Field(
        default=None, description="Turn about the axis from level, clockwise seen from behind."
    )


class MatchableFigures(StrictModel):
    """What dense matching can make of what the cameras see."""

    share: Number = Field(description="Share in a pair or more, of the points that can be.")
    reachable_share: Number = Field(
        description="Share of the points that two cameras could match wherever they stood."
    )
    shared: list[list[Number]] = Field(
        description="Share of the points that each pair of cameras can match."
    )
    connected: bool = Field(description="Whether all cameras are one group.")
    groups: list[list[str]] = Field(
        description="Names of the cameras that hang together by the surface they share."
    )


class QualityFigures(StrictModel):
    """Every figure of a network of cameras."""

    cost_mm2: Number = Field(description="Mean norm of the eigenvalues of Q (Eq 7).")
    sigma_median_mm: Number = Field(description="Median of the points' sigma.")
    sigma_p95_mm: Number = Field(description="95th percentile of the points' sigma.")
    sigma_max_mm: Number = Field(description="Largest sigma.")
    coverage: list[ShareOfViews] = Field(description="Share of points by number of views.")
    in_focus_share: Number = Field(description="Share of views that are sharp.")
    in_frame_share: Number = Field(description="Share of views that are in frame.")
    base_height: list[list[Number]] = Field(description="B/H of camera pairs.")
    convergence_deg: list[list[Number]] = Field(description="Angle between axes of camera pairs.")
    cameras: list[CameraFigures] = Field(description="Figures per camera.")
    matchable: MatchableFigures | None = Field(
        default=None, description="Pairs of cameras that can match."
    )


class ConstraintFigures(StrictModel):
    """One limit at its worst place."""

    name: str = Field(description="`family/subject`, for example `frame/cam03`.")
    value: Number = Field(description="What was reached.")
    limit: Number = Field(description="What was asked for.")
    sense: Literal["<=", ">=", "=="] = Field(description="Direction of the limit.")
    unit: str = Field(description="Unit of value, limit and slack.")
    slack: Number = Field(description="Room to spare; negative when the limit is broken.")
    active: bool = Field(description="Whether the limit binds.")
    satisfied: bool = Field(description="Whether the limit holds.")


class StartFigures(StrictModel):
    """How one start went."""

    index: int = Field(description="Number of the start, from 0.")
    kind: str = Field(description="How the start was made.")
    feasible: bool = Field(description="Whether its result holds all limits.")
    cost_mm2: Number = Field(description="Cost it reached.")
    violation: Number = Field(description="Largest scaled breach of a limit.")
    iterations: int = Field(description="Iterations of the solver.")
    rounds: int = Field(description="Rounds of constraint exchange.")
    why_stopped: str = Field(description="Why it stopped.")


class ConflictFigures(StrictModel):
    """A limit that takes part in a contradiction."""

    family: str = Field(description="The kind of limit.")
    unit: str = Field(description="Unit of the next two.")
    give: Number = Field(description="By how much it gives way in the nearest design.")
    give_alone: Number = Field(description="By how much if it alone gave way; null: not enough.")


class BoundFigures(StrictModel):
    """How good any network on a grid of candidates could be."""

    lower_mm2: float = Field(description="The mean |Q| of no network on the grid is below this.")
    cost_mm2: float = Field(description="That of the design, over the same points.")
    gap_share: float = Field(description="By which share of it the cost could at most be less.")
    candidates: int = Field(description="How many places were looked at.")
    points: int = Field(description="How many check points, weighted to stand for all.")
    unseen_share: float = Field(description="Share of the check points that no two places see.")


class SolverFigures(StrictModel):
    """Why the solver stopped and how good its answer is."""

    engine: str = Field(description="Which solver.")
    status: Literal["converged", "stopped", "infeasible"] = Field(description="How it ended.")
    why_stopped: str = Field(description="In words.")
    kkt_error: Number = Field(description="First-order optimality error.")
    iterations: int = Field(description="Iterations of the best start.")
    rounds: int = Field(description="Rounds of constraint exchange of the best start.")
    seed: int = Field(description="Seed; the same seed gives the same design.")
    seconds: Number = Field(description="Wall time; the only figure that differs between runs.")
    starts: list[StartFigures] = Field(description="All starts.")
    conflicts: list[ConflictFigures] = Field(description="Limits that contradict each other.")
    starts_note: str = Field(
        default="", description="Why starts were tried that the strategy is not made of."
    )
    bound: BoundFigures | None = Field(
        default=None, description="How good any other network could be, where that was asked for."
    )


class PointFigures(StrictModel):
    """Per point of the region, as parallel lists of N."""

    position_mm: list[Vector] = Field(description="Where the points are.")
    normal: list[Vector] = Field(description="Outward normals.")
    covariance_mm2: list[Covariance] = Field(description="xx, xy, xz, yy, yz, zz of each.")
    sigma_mm: list[Number] = Field(description="Longest semi-axis of the error ellipsoid, 1 sigma.")
    views: list[int] = Field(description="How many cameras see it.")
    in_focus: list[int] = Field(description="How many of them see it sharp.")
    matchable_pairs: list[int] | None = Field(
        default=None, description="How many pairs of cameras can match it."
    )


class StartPose(StrictModel):
    """Where a camera stood before the optimisation."""

    name: str = Field(description="Name of the camera.")
    position_mm: Vector = Field(description="Projection centre in the rig frame.")
    rotation_rig_to_camera: Matrix = Field(description="Orientation.")
    omega_phi_kappa_deg: Vector = Field(description="The same as angles.")
    focus_distance_mm: Number = Field(description="Focus setting.")


class StartState(StrictModel):
    """The best start before optimisation, with the same figures."""

    cameras: list[StartPose] = Field(description="Poses.")
    quality: QualityFigures = Field(description="Figures.")
    constraints: list[ConstraintFigures] = Field(description="Limits.")
    points: PointFigures = Field(description="Figures per point.")


class ScanNoteEntry(StrictModel):
    """Something to know about the scan."""

    kind: str = Field(description="`inferred`, `changed` or `warning`.")
    text: str = Field(description="In words.")


class ScanFacts(StrictModel):
    """The scan a design was made for."""

    name: str = Field(description="Name of the file.")
    vertices: int = Field(description="Number of vertices after cleaning.")
    faces: int = Field(description="Number of faces; 0 for a cloud.")
    size_mm: Vector = Field(description="Extent along X, Y and Z of the rig frame.")
    rig_from_file: list[Annotated[list[float], Len(4, 4)]] = Field(
        description="4 x 4 matrix from the file's coordinates to the rig frame."
    )
    notes: list[ScanNoteEntry] = Field(description="What was inferred, changed, or looks odd.")


class DesignFile(StrictModel):
    """The root of a design file.

    A file that Rigwright writes holds every key. One that describes an existing rig needs
    ``schema`` and ``cameras`` only.
    """

    schema_: Literal["rigwright.design/1"] = Field(alias="schema", description="Version.")
    rigwright: str | None = Field(default=None, description="Version of the program that wrote it.")
    name: str | None = Field(default=None, description="Name of the rig.")
    feasible: bool | None = Field(default=None, description="Whether every limit is satisfied.")
    cameras: Annotated[list[PlacedCamera], Len(1, 1000)] = Field(description="The cameras.")
    quality: QualityFigures | None = Field(default=None, description="Figures of the design.")
    constraints: list[ConstraintFigures] | None = Field(default=None, description="All limits.")
    solver: SolverFigures | None = Field(default=None, description="The solver's word.")
    points: PointFigures | None = Field(default=None, description="Figures per point.")
    start: StartState | None = Field(default=None, description="The start, before optimisation.")
    scan: ScanFacts | None = Field(default=None, description="The scan.")
    rig: RigFile | None = Field(default=None, description="The rig file as it was used.")
