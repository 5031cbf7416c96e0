"""The keys of a target file, checked strictly."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from common.files.strict import StrictModel


def _tuple(value: object) -> object:
    """A list as a tuple: a body over HTTP is parsed before it is checked, and JSON has lists."""
    return tuple(value) if isinstance(value, list) else value


Triple = Annotated[tuple[float, float, float], BeforeValidator(_tuple)]
Sigma = Annotated[float, Field(ge=0.0, allow_inf_nan=True)]
Sigmas = Annotated[tuple[Sigma, Sigma, Sigma], BeforeValidator(_tuple)]


class RulerModel(StrictModel):
    """A ruler as drawn and as measured on the print."""

    drawn_mm: float
    measured_mm: float
    sigma_mm: float = 0.1


class TargetPlaceModel(StrictModel):
    """One target; without ``position_mm`` its place is not known."""

    number: int
    position_mm: Triple | None = None
    sigma_mm: Sigmas | None = None


class PlateModel(StrictModel):
    """A ChArUco plate."""

    name: str
    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    dictionary: str
    first_marker: int = 0
    legacy: bool = False
    inverted: bool = False
    fixed: bool = False
    sigma_mm: Sigmas = (0.02, 0.02, 0.1)
    ruler: RulerModel | None = None
    back_mm: float | None = None


class _BoardModel(StrictModel):
    name: str
    columns: int
    rows: int
    inverted: bool = False
    fixed: bool = False
    sigma_mm: Sigmas = (0.02, 0.02, 0.1)
    ruler: RulerModel | None = None


class ChessboardModel(_BoardModel):
    """A plain chessboard: squares, not inner corners, each way."""

    square_mm: float
    upright: bool = False


class AprilGridModel(_BoardModel):
    """An AprilGrid as Kalibr prints it."""

    tag_mm: float
    gap_mm: float
    dictionary: str = "DICT_APRILTAG_36H11"
    first_tag: int = 0
    from_top: bool = False
    border_modules: Literal[1, 2] = 2
    tag_turn_deg: Literal[0, 90, 180, 270] = 180


class DotGridModel(_BoardModel):
    """A symmetric or asymmetric grid of dots."""

    spacing_mm: float
    dot_radius_mm: float
    asymmetric: bool = False
    upright: bool = False


class MarkersModel(StrictModel):
    """Square markers on a carrier."""

    name: str
    dictionary: str
    size_mm: float
    dot: bool = False
    corners: bool = False
    inverted: bool = False
    fixed: bool = False
    ruler: RulerModel | None = None
    targets: Annotated[list[TargetPlaceModel], Field(min_length=1)]


class RingsModel(StrictModel):
    """Ring-coded targets on a carrier, or a scale bar."""

    name: str
    dot_radius_mm: float
    bits: Literal[12, 14] = 12
    code_distance: Literal[1, 2] = 2
    mirror_unique: bool = True
    complement_unique: bool = False
    inverted: bool = False
    fixed: bool = False
    bar: bool = False
    ruler: RulerModel | None = None
    targets: Annotated[list[TargetPlaceModel], Field(min_length=1)]


class DistanceModel(StrictModel):
    """A measured distance between two targets of one carrier."""

    first: str
    second: str
    length_mm: float
    sigma_mm: float


class TargetsModel(StrictModel):
    """The whole file."""

    schema_: Literal["rigwright.targets/1"] = Field(alias="schema")
    name: str
    plates: list[PlateModel] = Field(default_factory=list)
    chessboards: list[ChessboardModel] = Field(default_factory=list)
    aprilgrids: list[AprilGridModel] = Field(default_factory=list)
    dot_grids: list[DotGridModel] = Field(default_factory=list)
    markers: list[MarkersModel] = Field(default_factory=list)
    rings: list[RingsModel] = Field(default_factory=list)
    distances: list[DistanceModel] = Field(default_factory=list)
