"""How a scan stands: its turn to the rig frame, its scale and its face, found or given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from common.errors import InputError
from geometry.arrays import Floats
from geometry.axes import DIRECTIONS, GLTF_AXES, RIG_AXES, Axes
from geometry.locating.finding import SURE, FoundFace, angle_deg, locate_face
from geometry.locating.template import face_template
from geometry.scan import FacePlace, ScanNote
from geometry.scanoptions import ScanOptions
from geometry.surface import SurfacePoints
from geometry.units import MM_PER_UNIT, UNIT_NAMES, mm_per_unit, size_warning

_HEAD_REMEDY = (
    'give up and front, for example up = "+y", front = "+z", or nose_tip, left_eye and right_eye'
)
_SIDE_DEG = 2.5
_NOD_DEG = 12.0
_ASKEW_DEG = 12.0
_SCAN_MM = (110.0, 1000.0)
_LADDER = 1.7
_AGREED = 1.2


@dataclass(frozen=True, eq=False)
class Standing:
    """``rotation_file_to_rig`` (3, 3), millimetres per unit of the file, and what was inferred.

    ``face`` is in the rig frame; None when it was not looked for or not found for certain.
    """

    rotation_file_to_rig: Floats
    mm_per_unit: float
    face: FacePlace | None
    notes: tuple[ScanNote, ...]


def stand(
    samples: SurfacePoints, kind: str, declared: str | None, options: ScanOptions
) -> Standing:
    """How a scan of evenly spread points, in units of the file, stands.

    ``kind`` is the format, ``declared`` the unit that the file states. Raises
    :class:`InputError` when a head's pose can neither be found for certain nor is given.
    """
    if options.subject == "object":
        return _object(kind, declared, options)
    if options.left_eye is not None:
        return _landmarks(samples, declared, options)
    found, scale, notes = _found(samples, declared, options)
    rotation, axes_notes = _rotation(found, kind, options)
    turned = samples.points_mm @ rotation.T
    if scale is None:
        scale, note = mm_per_unit(turned, declared)
        notes += (note,)
    if options.scale is not None or options.units != "auto":
        notes += size_warning(scale * np.ptp(turned, axis=0))
    face = None
    if found is not None:
        face = _placed(found, rotation, scale, options)
        axes_notes += _turned_away(face)
    return Standing(rotation, scale, face, axes_notes + notes)


def _placed(found: FoundFace, rotation: Floats, scale: float, options: ScanOptions) -> FacePlace:
    tip = scale * rotation @ found.nose_tip_mm
    if options.nose_tip is not None:
        tip = scale * rotation @ np.array(options.nose_tip)
    axes = found.rotation_to_rig @ rotation.T
    return FacePlace(tip, axes, found.confidence)


def _object(kind: str, declared: str | None, options: ScanOptions) -> Standing:
    rotation = options.rotation
    notes: tuple[ScanNote, ...] = ()
    if rotation is None:
        gltf = kind in ("GLB", "glTF")
        axes = _completed(GLTF_AXES if gltf else RIG_AXES, options)
        rotation = axes.rotation_file_to_rig
        notes = (_axes_note(axes, f"as {'glTF' if gltf else 'the rig frame'} has them"),)
    if options.scale is not None or options.units != "auto":
        return Standing(rotation, _given_scale(options), None, notes)
    unit = declared or "mm"
    return Standing(
        rotation, MM_PER_UNIT[unit], None, (*notes, ScanNote("inferred", f"units: {unit}"))
    )


def _completed(usual: Axes, options: ScanOptions) -> Axes:
    """The axes nearest to the usual ones that have the one direction given."""
    return _nearest_axes(usual.rotation_file_to_rig, options)


def _nearest_axes(rotation: Floats, options: ScanOptions) -> Axes:
    choices = [
        Axes(up, front)
        for up in DIRECTIONS
        for front in DIRECTIONS
        if options.up in ("auto", up)
        and options.front in ("auto", front)
        and DIRECTIONS[up] @ DIRECTIONS[front] == 0.0
    ]
    return min(choices, key=lambda axes: angle_deg(axes.rotation_file_to_rig, rotation))


def _given_scale(options: ScanOptions) -> float:
    return MM_PER_UNIT[options.units] if options.scale is None else options.scale


def _axes_note(axes: Axes, basis: str) -> ScanNote:
    return ScanNote("inferred", f"axes: {axes.up} is up, {axes.front} is front, {basis}")


def _landmarks(samples: SurfacePoints, declared: str | None, options: ScanOptions) -> Standing:
    """From the nose tip and the outer corners of the eyes, laid on those of the template."""
    template = face_template()
    given = np.array([options.nose_tip, options.left_eye, options.right_eye], dtype=np.float64)
    wanted = np.stack([np.zeros(3), template.left_eye_mm, template.right_eye_mm])
    rotation = Rotation.align_vectors(wanted[1:], given[1:] - given[0])[0].as_matrix()
    wide = float(np.linalg.norm(wanted[1] - wanted[2]) / np.linalg.norm(given[1] - given[2]))
    if options.scale is not None or options.units != "auto":
        scale = _given_scale(options)
        notes = size_warning(scale * np.ptp(samples.points_mm @ rotation.T, axis=0))
    else:
        scale, note = _unit_of(wide, declared, "the distance of the eyes")
        notes = (note,)
    face = FacePlace(scale * rotation @ given[0], np.eye(3), 1.0)
    text = "axes: from the nose tip and the eyes as given"
    return Standing(rotation, scale, face, (ScanNote("inferred", text), *notes))


def _unit_of(mm: float, declared: str | None, basis: str) -> tuple[float, ScanNote]:
    """The unit that is nearest to ``mm`` per unit, or that scale itself when none is near."""
    for unit in [declared] * (declared is not None) + list(MM_PER_UNIT):
        if unit is not None and abs(np.log(MM_PER_UNIT[unit] / mm)) < np.log(1.4):
            why = "as the file says" if unit == declared else f"from {basis}"
            return MM_PER_UNIT[unit], ScanNote("inferred", f"units: {UNIT_NAMES[unit]}, {why}")
    text = (
        f"units unknown: scaled by {mm:.4g} from {basis}, true to about a tenth; "
        "give units or scale if you know better"
    )
    return mm, ScanNote("warning", text)


def _found(
    samples: SurfacePoints, declared: str | None, options: ScanOptions
) -> tuple[FoundFace | None, float | None, tuple[ScanNote, ...]]:
    """The face in units of the file, and millimetres per unit where given or found."""
    if options.scale is not None or options.units != "auto":
        return _of_given_size(samples, declared, options)
    return _searched(samples, declared, options.rotation)


def _of_given_size(
    samples: SurfacePoints, declared: str | None, options: ScanOptions
) -> tuple[FoundFace | None, float, tuple[ScanNote, ...]]:
    scale = _given_scale(options)
    extents_mm = scale * np.ptp(samples.points_mm, axis=0)
    doubtful = size_warning(extents_mm)
    face = None
    # A scan out of all proportion would take all memory to search.
    if _SCAN_MM[0] / 2.0 < extents_mm.max() < 2.5 * _SCAN_MM[1]:
        face = _sure(samples, scale, options.rotation)
    if face is None and doubtful:
        # The size is obeyed and told; how it stands is seen at the size that faces have.
        face = _searched(samples, declared, options.rotation)[0]
    return face, scale, ()


def _searched(
    samples: SurfacePoints, declared: str | None, near: Floats | None
) -> tuple[FoundFace | None, float | None, tuple[ScanNote, ...]]:
    """The face at the units that are usual, else at any scale."""
    size = float(np.ptp(samples.points_mm, axis=0).max())
    for unit in [declared] * (declared is not None) + list(MM_PER_UNIT):
        if unit is None or not _SCAN_MM[0] <= size * MM_PER_UNIT[unit] <= _SCAN_MM[1]:
            continue
        face = _sure(samples, MM_PER_UNIT[unit], near)
        if face is not None:
            scale, note = _unit_of(MM_PER_UNIT[unit], declared, "the size of the face")
            return face, scale, (note,)
    return _unknown_scale(samples, declared, near, size)


def _unknown_scale(
    samples: SurfacePoints, declared: str | None, near: Floats | None, size: float
) -> tuple[FoundFace | None, float | None, tuple[ScanNote, ...]]:
    tried = _SCAN_MM[1] / size / 1.3
    while tried * size > _SCAN_MM[0]:
        face = _sure(samples, tried, near)
        if face is not None:
            rotation = face.rotation_to_rig if near is None else near
            scale, note = _unit_of(tried / face.size, declared, "the size of the face")
            whole, whole_note = mm_per_unit(samples.points_mm @ rotation.T, declared)
            # A whole head tells its size better than its face does.
            if abs(np.log(whole / scale)) < np.log(_AGREED):
                return face, whole, (whole_note,)
            return face, scale, (note,)
        tried /= _LADDER
    return None, None, ()


def _sure(samples: SurfacePoints, scale: float, near: Floats | None) -> FoundFace | None:
    """The face at a scale, in units of the file; None unless it is certain."""
    face = locate_face(SurfacePoints(scale * samples.points_mm, samples.normals), near)
    if face is None or face.confidence < SURE:
        return None
    return FoundFace(
        face.nose_tip_mm / scale, face.rotation_to_rig, face.size, face.confidence, face.misfit_mm
    )


def _rotation(
    found: FoundFace | None, kind: str, options: ScanOptions
) -> tuple[Floats, tuple[ScanNote, ...]]:
    if options.rotation is not None:
        return options.rotation, ()
    gltf = kind in ("GLB", "glTF")
    free = options.up == options.front == "auto"
    if found is None:
        if gltf and free:
            doubt = ScanNote("warning", f"no face was found for certain; {_HEAD_REMEDY}")
            return GLTF_AXES.rotation_file_to_rig, (
                _axes_note(GLTF_AXES, "as glTF has them"),
                doubt,
            )
        raise InputError(
            "axes-unclear",
            "no face was found for certain, so up and front are unclear",
            _HEAD_REMEDY,
        )
    axes = _nearest_axes(found.rotation_to_rig, options)
    # How far the head nods differs from person to person more than from file to file, so a
    # file whose side axis is the face's has its own axes kept.
    if not free or _is_upright(found.rotation_to_rig, axes):
        basis = "as glTF has them" if gltf and axes == GLTF_AXES else "from the shape of the face"
        return axes.rotation_file_to_rig, (_axes_note(axes, basis),)
    up, front = found.rotation_to_rig[2], -found.rotation_to_rig[1]
    text = (
        f"axes: the head stands askew in the file, up is ({_numbers(up)}) and front "
        f"({_numbers(front)}), from the shape of the face"
    )
    return found.rotation_to_rig, (ScanNote("inferred", text),)


def _is_upright(rotation: Floats, axes: Axes) -> bool:
    prescribed = axes.rotation_file_to_rig
    side = float(np.degrees(np.arccos(np.clip(rotation[0] @ prescribed[0], -1.0, 1.0))))
    return side <= _SIDE_DEG and angle_deg(rotation, prescribed) <= _NOD_DEG


def _numbers(vector: Floats) -> str:
    return ", ".join(f"{v:.3f}" for v in vector)


def _turned_away(face: FacePlace) -> tuple[ScanNote, ...]:
    turn = angle_deg(face.axes_rig, np.eye(3))
    if turn <= _ASKEW_DEG:
        return ()
    text = (
        f"with the axes given the face looks {turn:.0f} degrees aside; leave up and front out to "
        "have it turned straight"
    )
    return (ScanNote("warning", text),)
