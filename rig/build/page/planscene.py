"""The rig with its structure as a GLB scene: the scene of the cameras, and every part a node."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from geometry.raycast import Occluder
from rig.build.drawings.views import plan_solids
from rig.build.mounts.plan import MountPlan
from rig.report.scene import GLTF_FROM_RIG, scene_glb

if TYPE_CHECKING:
    import trimesh

COLOURS: dict[str, tuple[int, int, int, int]] = {
    "member": (154, 167, 184, 255),
    "plate": (185, 194, 207, 255),
    "bracket": (201, 143, 60, 255),
    "wedge": (47, 158, 143, 255),
    "head": (91, 75, 138, 255),
    "cable": (179, 38, 30, 255),
}
IN_THE_CAMERAS_SCENE = frozenset({"camera", "lens"})


def plan_glb(plan: MountPlan, occluder: Occluder | None = None) -> bytes:
    """The scene as GLB bytes, metres and +Y up.

    Nodes: ``head``, per camera ``<name>/body``, ``<name>/lens`` and ``<name>/view``, and per
    solid of the structure ``<kind>/<owner>``, with ``#2`` and so on where an owner has more.
    """
    import trimesh

    cameras = tuple(mount.camera for mount in plan.mounts)
    glb = scene_glb(cameras, occluder or Occluder.none())
    scene = trimesh.load_scene(io.BytesIO(glb), file_type="glb")
    taken: dict[str, int] = {}
    for solid in plan_solids(plan):
        if solid.kind in IN_THE_CAMERAS_SCENE:
            continue
        name = f"{solid.kind}/{solid.owner}"
        taken[name] = taken.get(name, 0) + 1
        name += f"#{taken[name]}" if taken[name] > 1 else ""
        mesh = trimesh.convex.convex_hull(solid.corners_mm @ GLTF_FROM_RIG.T)
        mesh.visual = _paint(COLOURS.get(solid.kind, COLOURS["bracket"]))
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    return bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]


def _paint(rgba: tuple[int, int, int, int]) -> trimesh.visual.TextureVisuals:
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    material = PBRMaterial(  # type: ignore[no-untyped-call]
        baseColorFactor=rgba, metallicFactor=0.1, roughnessFactor=0.7, doubleSided=True
    )
    return TextureVisuals(material=material)  # type: ignore[no-untyped-call]
