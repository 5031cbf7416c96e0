"""Printed wedges that hold a camera's angles: their shape, and the files a printer takes."""

from rig.build.wedges.files import wedge_3mf, wedge_stl
from rig.build.wedges.recipe import PrintPart
from rig.build.wedges.solid import overhang_deg, print_part, wedge_corners_mm, wedge_mesh
from rig.build.wedges.step import wedge_step

__all__ = [
    "PrintPart",
    "wedge_3mf",
    "wedge_mesh",
    "wedge_step",
    "wedge_stl",
    "overhang_deg",
    "print_part",
    "wedge_corners_mm",
]
