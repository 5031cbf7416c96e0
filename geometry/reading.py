"""Reading a scan file: checked, cleaned, turned and scaled into the rig frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints
from geometry.axes import DIRECTIONS, GLTF_AXES, RIG_AXES, Axes, infer_axes, surface_samples
from geometry.cleaning import clean_mesh, drop_not_finite
from geometry.cloud import clean_cloud
from geometry.loading import RawScan, load_raw
from geometry.scan import Scan, ScanNote, vertex_normals
from geometry.sniffing import check_file
from geometry.units import MM_PER_UNIT, mm_per_unit, size_warning

_MAX_COORDINATE_MM = 1e6


@dataclass(frozen=True)
class ScanOptions:
    """What is known about a scan file; ``auto`` is inferred from the format and the shape.

    ``units`` is ``auto``, ``mm``, ``cm``, ``m`` or ``inch``; ``scale``, in millimetres per unit of
    the file, overrides it. ``up`` and ``front`` are ``auto`` or a direction of the file such as
    ``+y``. ``subject`` is ``head``, or ``object`` for anything else, which is then taken to
    stand in the rig frame, in millimetres, unless its format says otherwise.
    """

    units: str = "auto"
    scale: float | None = None
    up: str = "auto"
    front: str = "auto"
    subject: str = "head"

    def __post_init__(self) -> None:
        directions = ("auto", *DIRECTIONS)
        for name, value, known in (
            ("units", self.units, ("auto", *MM_PER_UNIT)),
            ("up", self.up, directions),
            ("front", self.front, directions),
            ("subject", self.subject, ("head", "object")),
        ):
            if value not in known:
                raise InputError(
                    f"scan-{name}", f"{name} {value!r} is not known", f"give {', '.join(known)}"
                )
        if self.scale is not None and not 0.0 < self.scale < np.inf:
            raise InputError(
                "scan-scale", f"a scale of {self.scale} makes no sense", "give mm per file unit"
            )
        if "auto" not in (self.up, self.front):
            Axes(self.up, self.front)


def read_scan(path: Path, options: ScanOptions | None = None) -> Scan:
    """The scan in a file, in the rig frame, with notes of what was inferred and changed.

    Reads GLB, glTF, OBJ, PLY, STL, 3MF, OFF and text points (x y z, with or without normals).
    Raises :class:`InputError` (:class:`TooLargeError`, :class:`NotFoundError`) with a remedy for
    every file that cannot be used.
    """
    options = options or ScanOptions()
    kind = check_file(path)
    raw, notes = drop_not_finite(load_raw(path, kind))
    if len(raw.faces):
        mesh = clean_mesh(raw, drop_pieces=options.subject == "head")
        vertices, faces, normals = (
            mesh.vertices,
            mesh.faces,
            vertex_normals(mesh.vertices, mesh.faces),
        )
        notes += mesh.notes
    else:
        vertices, normals, cloud_notes = clean_cloud(raw, closed=options.subject == "head")
        faces = raw.faces
        notes += cloud_notes
    axes, scale, frame_notes = _frame(vertices, faces, kind, raw, options)
    return _placed(vertices, faces, normals, axes, scale, notes + frame_notes)


def _placed(
    vertices: Floats,
    faces: Ints,
    normals: Floats,
    axes: Axes,
    scale: float,
    notes: tuple[ScanNote, ...],
) -> Scan:
    rotation = axes.rotation_file_to_rig
    vertices_mm = scale * vertices @ rotation.T
    if np.abs(vertices_mm).max() > _MAX_COORDINATE_MM:
        problem = "coordinates of the scan lie more than a kilometre from its origin"
        remedy = "move the scan to its origin, check its units and export it again"
        raise InputError("scan-coordinates", problem, remedy)
    rig_from_file = np.eye(4)
    rig_from_file[:3, :3] = scale * rotation
    return Scan(vertices_mm, faces, normals @ rotation.T, notes, rig_from_file)


def _frame(
    vertices: Floats, faces: Ints, kind: str, raw: RawScan, options: ScanOptions
) -> tuple[Axes, float, tuple[ScanNote, ...]]:
    """Axes and millimetres per unit, with notes of what was inferred."""
    samples = surface_samples(vertices, faces)
    axes, axes_notes = _axes(samples, kind, options)
    turned = samples @ axes.rotation_file_to_rig.T
    if options.scale is not None or options.units != "auto":
        scale = MM_PER_UNIT[options.units] if options.scale is None else options.scale
        warnings = size_warning(scale * np.ptp(turned, axis=0)) if options.subject == "head" else ()
        return axes, scale, axes_notes + warnings
    if options.subject == "object":
        unit = raw.unit or "mm"
        return axes, MM_PER_UNIT[unit], (*axes_notes, ScanNote("inferred", f"units: {unit}"))
    scale, note = mm_per_unit(turned, raw.unit)
    return axes, scale, (*axes_notes, note)


def _axes(samples: Floats, kind: str, options: ScanOptions) -> tuple[Axes, tuple[ScanNote, ...]]:
    if "auto" not in (options.up, options.front):
        return Axes(options.up, options.front), ()
    prescribed = GLTF_AXES if kind in ("GLB", "glTF") else RIG_AXES
    free = options.up == options.front == "auto"
    if free and (options.subject == "object" or prescribed is GLTF_AXES):
        axes, basis = (
            prescribed,
            f"as {'glTF' if prescribed is GLTF_AXES else 'the rig frame'} has them",
        )
    else:
        axes, usual = infer_axes(samples, options.up, options.front)
        basis = (
            "the usual ones, the shape leaves a choice" if usual else "from the shape of the head"
        )
    text = f"axes: {axes.up} is up, {axes.front} is front, {basis}"
    notes = (ScanNote("inferred", text),)
    return axes, notes + (_axes_doubt(samples, axes) if options.subject == "head" else ())


def _axes_doubt(samples: Floats, axes: Axes) -> tuple[ScanNote, ...]:
    """A warning when the shape speaks clearly against the axes that the format prescribes."""
    try:
        likely, usual = infer_axes(samples)
    except InputError:
        return ()
    if usual or likely == axes:
        return ()
    text = (
        f"the shape looks like a head with {likely.up} up and {likely.front} front; "
        "give up and front if that is so"
    )
    return (ScanNote("warning", text),)
