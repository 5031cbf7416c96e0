"""Agisoft Metashape: cameras as XML, and reference coordinates as CSV.

XML: camera to chunk, metres, x right, y down, z forward; ``cx`` and ``cy`` count from the middle
of the image, and Metashape's p1 and p2 are OpenCV's p2 and p1. CSV: projection centres and angles
for the Reference pane.
"""

from __future__ import annotations

import csv
import io
from xml.etree import ElementTree as Xml

from geometry.camera import Camera, LensModel
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_stem
from geometry.exchange.conventions import (
    METRES_PER_MM,
    camera_to_rig,
    number,
    numbers,
    principal_offset_px,
    yaw_pitch_roll_deg,
)

LOCAL_METRES = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'
CSV_COLUMNS = (
    *("label", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "roll_deg"),
    *("omega_deg", "phi_deg", "kappa_deg"),
)


def _leaf(parent: Xml.Element, tag: str, text: str) -> None:
    Xml.SubElement(parent, tag).text = text


def _sensor(parent: Xml.Element, index: int, label: str, camera: Camera) -> None:
    width, height = (str(side) for side in camera.image_size_px)
    sensor = Xml.SubElement(parent, "sensor", id=str(index), label=label, type="frame")
    Xml.SubElement(sensor, "resolution", width=width, height=height)
    pitch = number(camera.pixel_pitch_mm)
    for name, value in (
        ("pixel_width", pitch),
        ("pixel_height", pitch),
        ("focal_length", number(camera.focal_length_mm)),
    ):
        Xml.SubElement(sensor, "property", name=name, value=value)
    calibration = Xml.SubElement(sensor, "calibration", {"type": "frame", "class": "initial"})
    Xml.SubElement(calibration, "resolution", width=width, height=height)
    k1, k2, p1, p2, k3 = camera.distortion
    cx, cy = principal_offset_px(camera)
    values = {"f": camera.focal_length_px, "cx": cx, "cy": cy}
    values |= {"k1": k1, "k2": k2, "k3": k3, "p1": p2, "p2": p1}
    for tag, value in values.items():
        _leaf(calibration, tag, number(value))


def write_xml(cameras: Cameras, _options: ExportOptions) -> Files:
    """``cameras.xml``: one sensor per camera, because each is calibrated on its own."""
    document = Xml.Element("document", version="2.0.0")
    chunk = Xml.SubElement(document, "chunk", label="Rig", enabled="true")
    count = str(len(cameras))
    sensors = Xml.SubElement(chunk, "sensors", next_id=count)
    places = Xml.SubElement(chunk, "cameras", next_id=count, next_group_id="0")
    for index, camera in enumerate(cameras):
        stem = image_stem(camera.name)
        _sensor(sensors, index, stem, camera.camera)
        identity = {"id": str(index), "sensor_id": str(index), "label": stem}
        place = Xml.SubElement(places, "camera", identity)
        _leaf(place, "transform", numbers(camera_to_rig(camera.pose, METRES_PER_MM)))
    _leaf(chunk, "reference", LOCAL_METRES)
    Xml.indent(document)
    return {"cameras.xml": Xml.tostring(document, encoding="utf-8", xml_declaration=True) + b"\n"}


def write_csv(cameras: Cameras, _options: ExportOptions) -> Files:
    """``reference.csv``: give yaw, pitch and roll, or omega, phi and kappa, not both."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for camera in cameras:
        values = [
            *(camera.pose.position_rig_mm * METRES_PER_MM),
            *yaw_pitch_roll_deg(camera.pose),
            *camera.pose.omega_phi_kappa_deg,
        ]
        writer.writerow([image_stem(camera.name), *map(number, values)])
    return {"reference.csv": text.getvalue().encode()}


XML = Format(
    "metashape-xml",
    "Agisoft Metashape",
    "cameras with calibrations and poses (File, Import, Import Cameras)",
    ("cameras.xml",),
    write_xml,
)
CSV = Format(
    "metashape-csv",
    "Agisoft Metashape",
    "projection centres and angles for the Reference pane",
    ("reference.csv",),
    write_csv,
    tuple(LensModel),
)
