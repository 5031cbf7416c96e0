"""Metashape's camera XML.

Metashape counts pixels from the corner of the image (the centre of the first is at 0.5), gives
the principal point from the middle of the image, calls p1 what OpenCV calls p2 and the other way
round, and has b1 in pixels: ``u = w / 2 + cx + x' (f + b1)`` (its manual, appendix on camera
models). Camera axes are OpenCV's; transforms lead from the camera to the chunk.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from calibration.adjustment.camera import CalibratedCamera, Interior
from calibration.exports.text import METRE, numbers

HALF_PIXEL = 0.5


def metashape_xml(cameras: tuple[CalibratedCamera, ...]) -> str:
    """A document with one sensor and one camera each, in metres, for its import of cameras."""
    document = ET.Element("document", version="2.0.0")
    chunk = ET.SubElement(document, "chunk", label="rig", enabled="true")
    sensors = ET.SubElement(chunk, "sensors", next_id=str(len(cameras)))
    for k, camera in enumerate(cameras):
        _sensor(sensors, k, camera)
    placed = ET.SubElement(chunk, "cameras", next_id=str(len(cameras)), next_group_id="0")
    for k, camera in enumerate(cameras):
        one = ET.SubElement(placed, "camera", id=str(k), sensor_id=str(k), label=camera.name)
        ET.SubElement(one, "transform").text = _transform(camera)
    reference = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'
    ET.SubElement(chunk, "reference").text = reference
    ET.indent(document)
    text = ET.tostring(document, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _sensor(sensors: ET.Element, k: int, camera: CalibratedCamera) -> None:
    width, height = (str(v) for v in camera.image_size_px)
    sensor = ET.SubElement(sensors, "sensor", id=str(k), label=camera.name, type="frame")
    ET.SubElement(sensor, "resolution", width=width, height=height)
    calibration = ET.SubElement(sensor, "calibration", {"type": "frame", "class": "adjusted"})
    ET.SubElement(calibration, "resolution", width=width, height=height)
    for name, value in _values(camera.interior, camera.image_size_px).items():
        ET.SubElement(calibration, name).text = repr(float(value))


def _values(interior: Interior, size_px: tuple[int, int]) -> dict[str, float]:
    middle = np.array(size_px) / 2.0
    cx, cy = interior.principal_point_px + HALF_PIXEL - middle
    k1, k2, p1, p2, k3 = (float(v) for v in interior.distortion)
    return {
        "f": interior.focal_length_px,
        "cx": float(cx),
        "cy": float(cy),
        "b1": interior.focal_length_px * interior.affinity,
        "k1": k1,
        "k2": k2,
        "k3": k3,
        "p1": p2,
        "p2": p1,
    }


def _transform(camera: CalibratedCamera) -> str:
    matrix = np.eye(4)
    matrix[:3, :3] = camera.pose.rotation_rig_to_camera.T
    matrix[:3, 3] = METRE * camera.pose.position_rig_mm
    return numbers(matrix.ravel(), " ")
