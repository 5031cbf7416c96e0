"""Files for a printer: STL and 3MF, the part lying as it is printed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig.brackets.recipe import PrintPart
from rig.brackets.solid import bracket_mesh

if TYPE_CHECKING:
    import trimesh


def bracket_stl(part: PrintPart, mesh: trimesh.Trimesh | None = None) -> bytes:
    """The wedge as binary STL. STL names no unit; the numbers are millimetres."""
    from trimesh.exchange.stl import export_stl

    solid = bracket_mesh(part) if mesh is None else mesh
    return bytes(export_stl(solid))


def bracket_3mf(part: PrintPart, mesh: trimesh.Trimesh | None = None) -> bytes:
    """The wedge as 3MF, unit millimetre, the object named after the wedge."""
    import trimesh

    solid = bracket_mesh(part) if mesh is None else mesh
    solid.units = "mm"
    scene = trimesh.Scene()
    scene.add_geometry(solid, node_name=part.name, geom_name=part.name)
    scene.units = "mm"
    return bytes(scene.export(file_type="3mf"))  # type: ignore[no-untyped-call]
