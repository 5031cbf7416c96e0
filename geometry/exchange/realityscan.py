"""RealityScan (once RealityCapture): one XMP file beside each image.

World to camera row by row, projection centre in metres, x right, y down, z forward. Lengths in
the image are counted in its longer side: the focal length times 36 mm, the principal point from
the middle. The six distortion terms are k1, k2, k3, k4, t1, t2, where t1 is OpenCV's p2 and t2
its p1, for coordinates divided by depth.
"""

from __future__ import annotations

from geometry.camera import Camera, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_stem
from geometry.exchange.conventions import METRES_PER_MM, number, numbers, principal_offset_px

FULL_FRAME_WIDTH_MM = 36.0

_TEMPLATE = """\
<x:xmpmeta xmlns:x="adobe:ns:meta/">
  <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
    <rdf:Description rdf:about="" xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#"
       xcr:Version="3" xcr:PosePrior="{prior}" xcr:Coordinates="absolute"
       xcr:DistortionModel="{model}" xcr:FocalLength35mm="{focal}" xcr:Skew="0"
       xcr:AspectRatio="1" xcr:PrincipalPointU="{u}" xcr:PrincipalPointV="{v}"
       xcr:CalibrationPrior="{prior}" xcr:CalibrationGroup="-1" xcr:DistortionGroup="-1"
       xcr:InTexturing="1" xcr:InMeshing="1">
      <xcr:Rotation>{rotation}</xcr:Rotation>
      <xcr:Position>{position}</xcr:Position>
      <xcr:DistortionCoeficients>{terms}</xcr:DistortionCoeficients>
    </rdf:Description>
  </rdf:RDF>
</x:xmpmeta>
"""
# "Coeficients" is how the program itself spells it; spelt right, it is ignored.


MODEL = "brown3t2"
"""Said of every camera, with terms of 0 where there is no distortion: AliceVision's importer of
these files takes no other model (its ``importXMP``), RealityScan takes it as well as any."""


def _terms(camera: Camera) -> str:
    """The six distortion terms."""
    k1, k2, p1, p2, k3 = camera.distortion
    return " ".join(map(number, (k1, k2, k3, 0.0, p2, p1)))


def _xmp(rig_camera: RigCamera, options: ExportOptions) -> bytes:
    camera, pose = rig_camera.camera, rig_camera.pose
    longer = max(camera.image_size_px)
    u, v = principal_offset_px(camera) / longer
    text = _TEMPLATE.format(
        prior=options.pose_prior,
        model=MODEL,
        focal=number(camera.focal_length_px * FULL_FRAME_WIDTH_MM / longer),
        u=number(u),
        v=number(v),
        rotation=numbers(pose.rotation_rig_to_camera),
        position=numbers(pose.position_rig_mm * METRES_PER_MM),
        terms=_terms(camera),
    )
    return text.encode()


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """One ``.xmp`` per camera, named like its image."""
    return {f"{image_stem(camera.name)}.xmp": _xmp(camera, options) for camera in cameras}


FORMAT = Format(
    "realityscan",
    "RealityScan, RealityCapture",
    "XMP files to lie beside the images",
    ("{image}.xmp",),
    write,
)
