"""From a scan to a subject: find the region, sample it, say what was done."""

from __future__ import annotations

from dataclasses import dataclass

from common.errors import InputError
from geometry.face import FaceRegion, RegionBox, RegionSphere, find_face
from geometry.raycast import Occluder
from geometry.sampling import surface_samples, voxel_downsample, voxel_size_for
from geometry.scan import Scan, ScanNote
from geometry.subject import Subject
from geometry.surface import SurfacePoints

_SAMPLES_PER_POINT = 12
_REGION_SHARE = 0.2
"""A face is about a fifth of a head's area; sampling allows for that."""


@dataclass(frozen=True, eq=False)
class SubjectOptions:
    """Which part of a scan to design for, and with how many points.

    ``region``: ``face`` finds the face, ``all`` takes the whole surface, ``targets`` takes the
    points of a cloud exactly as they are, with nothing that could hide them. A ``box`` or a
    ``sphere`` replaces the found region.
    """

    region: str = "face"
    box: RegionBox | None = None
    sphere: RegionSphere | None = None
    design_count: int = 1000
    check_count: int = 4000
    seed: int = 0

    def __post_init__(self) -> None:
        if self.region not in ("face", "all", "targets"):
            raise InputError(
                "region", f"region {self.region!r} is not known", "give face, all or targets"
            )
        if min(self.design_count, self.check_count) < 4:
            raise InputError(
                "point-count", "fewer than 4 points are asked for", "ask for at least 4"
            )
        if self.box is not None and self.sphere is not None:
            raise InputError("region", "a box and a sphere are both given", "give one of them")


@dataclass(frozen=True, eq=False)
class PreparedSubject:
    """A subject with where it came from. ``region`` is None unless a face was found."""

    subject: Subject
    region: FaceRegion | None
    scan: Scan
    notes: tuple[ScanNote, ...]


def prepare_subject(scan: Scan, options: SubjectOptions | None = None) -> PreparedSubject:
    """Find the region, choose design and check points by voxels, build the occluder.

    Raises :class:`InputError` when there is no face, or nothing in the given region.
    """
    chosen = options or SubjectOptions()
    if chosen.region == "targets":
        points = SurfacePoints(scan.vertices_mm, scan.normals)
        note = ScanNote("inferred", f"{len(points)} targets, taken as they are")
        return PreparedSubject(
            Subject(points, points, Occluder.none()), None, scan, (*scan.notes, note)
        )
    count = int(_SAMPLES_PER_POINT * max(chosen.design_count, chosen.check_count) / _REGION_SHARE)
    samples = surface_samples(scan, count, chosen.seed)
    region, points, notes = _region(scan, samples, chosen)
    design_voxel = voxel_size_for(points, chosen.design_count)
    check_voxel = voxel_size_for(points, chosen.check_count)
    subject = Subject(
        voxel_downsample(points, design_voxel),
        voxel_downsample(points, check_voxel),
        scan.occluder(),
    )
    text = (
        f"{len(subject.design_points)} design points from voxels of {design_voxel:.1f} mm, "
        f"{len(subject.check_points)} check points from voxels of {check_voxel:.1f} mm"
    )
    return PreparedSubject(subject, region, scan, (*scan.notes, *notes, ScanNote("inferred", text)))


def _region(
    scan: Scan, samples: SurfacePoints, options: SubjectOptions
) -> tuple[FaceRegion | None, SurfacePoints, tuple[ScanNote, ...]]:
    given = options.box or options.sphere
    if given is not None:
        inside = given.holds(samples.points_mm)
        if not inside.any():
            raise InputError(
                "region-empty",
                "the given region holds nothing of the scan",
                f"the scan reaches from {_corner(scan, 0)} to {_corner(scan, 1)} mm",
            )
        return None, samples.subset(inside), (ScanNote("inferred", "region as given"),)
    if options.region == "all":
        return None, samples, (ScanNote("inferred", "region: the whole surface"),)
    region, points = find_face(scan, samples)
    x, y, z = region.nose_tip_mm
    text = (
        f"face found: nose tip at ({x:z.0f}, {y:z.0f}, {z:z.0f}) mm, within "
        f"{region.radius_mm:g} mm of it; {region.excluded_share:.1%} of it is "
        "hard to see from the front and left out"
    )
    return region, points, (ScanNote("inferred", text),)


def _corner(scan: Scan, side: int) -> str:
    corner = scan.vertices_mm.min(axis=0) if side == 0 else scan.vertices_mm.max(axis=0)
    return "(" + ", ".join(f"{v:.0f}" for v in corner) + ")"
