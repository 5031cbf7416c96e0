"""Files for a printer: STL and 3MF, the part lying as it is printed."""

from __future__ import annotations

import io
import itertools
import re
import uuid
import zipfile
from typing import TYPE_CHECKING

from common.files.zip import zip_bytes
from rig.build.wedges.recipe import PrintPart
from rig.build.wedges.solid import wedge_mesh

if TYPE_CHECKING:
    import trimesh

UUID = re.compile(rb'UUID="[0-9a-f-]{36}"')


def wedge_stl(part: PrintPart, mesh: trimesh.Trimesh | None = None) -> bytes:
    """The wedge as binary STL. STL names no unit; the numbers are millimetres."""
    from trimesh.exchange.stl import export_stl

    solid = wedge_mesh(part) if mesh is None else mesh
    return bytes(export_stl(solid))


def wedge_3mf(part: PrintPart, mesh: trimesh.Trimesh | None = None) -> bytes:
    """The wedge as 3MF, unit millimetre, the object named after the wedge."""
    import trimesh

    solid = wedge_mesh(part) if mesh is None else mesh
    solid.units = "mm"
    scene = trimesh.Scene()
    scene.add_geometry(solid, node_name=part.name, geom_name=part.name)
    scene.units = "mm"
    return _same_each_time(bytes(scene.export(file_type="3mf")))  # type: ignore[no-untyped-call]


def _same_each_time(package: bytes) -> bytes:
    """The package with identifiers that follow from its content instead of from chance."""
    with zipfile.ZipFile(io.BytesIO(package)) as given:
        return zip_bytes({e.filename: _numbered(given.read(e)) for e in given.infolist()})


def _numbered(content: bytes) -> bytes:
    """A file of the package whose identifiers are counted from 1."""
    counted = itertools.count(1)
    return UUID.sub(lambda _: b'UUID="%s"' % str(uuid.UUID(int=next(counted))).encode(), content)
