"""Reconstructions: the surface that the pictures of one capture show."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from service.kinds.base import JobKind, Request, Result


class ReconstructionRequest(Request):
    """How to reconstruct. Everything may be left out."""

    name: Annotated[str, Field(max_length=100, description="What to call it.")] = ""
    frame: Annotated[
        str | None,
        Field(max_length=200, description="Which instant, where the pictures show several."),
    ] = None
    stride_px: Annotated[
        int, Field(ge=1, le=16, description="Pixels between the points of a picture.")
    ] = 2
    cell_mm: Annotated[
        float | None,
        Field(
            ge=0.05,
            le=50.0,
            description="About the edge of the mesh's triangles; without it 1.5 times the spacing "
            "of the points.",
        ),
    ] = None
    meshes: Annotated[
        tuple[Literal["ply", "glb", "obj"], ...],
        Field(max_length=3, description="How to write the surface: mesh.ply, mesh.glb, mesh.obj."),
    ] = ("ply", "glb")
    depth_maps: Annotated[
        bool,
        Field(description="Whether to write what each camera measured, as depthmaps/CAMERA.tif."),
    ] = False


class CameraPart(Result):
    """What one camera gave to a reconstruction."""

    camera: str
    tried: Annotated[int, Field(description="Patches tried.")]
    measured: Annotated[int, Field(description="Patches that matched.")]
    points: Annotated[int, Field(description="Points left when all cameras were heard.")]


class DoubtPart(Result):
    """What speaks against the picture of one camera."""

    camera: str
    kind: Annotated[str, Field(description="moved, foreign, blurred or dark.")]
    words: str


class ReconstructionResult(Result):
    """What was found, in short; ``cloud.ply`` holds the points, ``mesh.ply`` the surface."""

    frame: str
    points: int
    sigma_median_mm: float
    views_median: int
    centre_rig_mm: list[float]
    radius_mm: float
    cameras: list[CameraPart]
    mesh_faces: int
    mesh_area_mm2: float
    without_pictures: Annotated[
        list[str], Field(description="Cameras of the rig that have no picture of this instant.")
    ]
    doubts: Annotated[
        tuple[DoubtPart, ...], Field(description="Cameras that the others speak against.")
    ] = ()


RECONSTRUCTION = JobKind("reconstruction", ReconstructionRequest, ReconstructionResult)
