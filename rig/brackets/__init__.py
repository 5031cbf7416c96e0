"""Printed wedges that hold a camera's angles: their shape, and the files a printer takes."""

from rig.brackets.files import bracket_3mf, bracket_stl
from rig.brackets.recipe import PrintPart
from rig.brackets.solid import bracket_mesh, overhang_deg, print_part, wedge_corners_mm
from rig.brackets.step import bracket_step

__all__ = [
    "PrintPart",
    "bracket_3mf",
    "bracket_mesh",
    "bracket_step",
    "bracket_stl",
    "overhang_deg",
    "print_part",
    "wedge_corners_mm",
]
