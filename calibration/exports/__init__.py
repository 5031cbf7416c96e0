"""Calibrations in other programs' formats: the only modules that know their conventions."""

from calibration.exports.caliscope import caliscope_toml
from calibration.exports.colmap import colmap_files
from calibration.exports.kalibr import kalibr_yaml
from calibration.exports.metashape import metashape_xml
from calibration.exports.opencv import opencv_yaml

__all__ = ["caliscope_toml", "colmap_files", "kalibr_yaml", "metashape_xml", "opencv_yaml"]
