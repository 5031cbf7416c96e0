"""Reconstructions: the surface that the pictures of one capture show."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

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
    texture: Annotated[
        bool,
        Field(description="Whether mesh.glb and mesh.obj get a picture, cut from the pictures."),
    ] = False

    @model_validator(mode="after")
    def _has_a_mesh_for_its_texture(self) -> ReconstructionRequest:
        if self.texture and not {"glb", "obj"} & set(self.meshes):
            raise ValueError("a texture needs a mesh that can have one: give glb or obj to meshes")
        return self


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


class TexturePart(Result):
    """The picture on the mesh."""

    width_px: int
    height_px: int
    unseen_faces: Annotated[
        int,
        Field(description="Triangles that no camera sees whole; their points' colours are theirs."),
    ]


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
    texture: Annotated[
        TexturePart | None, Field(description="The picture on the mesh, where it was asked for.")
    ] = None
    doubts: Annotated[
        tuple[DoubtPart, ...], Field(description="Cameras that the others speak against.")
    ] = ()


RECONSTRUCTION = JobKind("reconstruction", ReconstructionRequest, ReconstructionResult)
