"""Printed wedges that hold a camera's angles: their shape, and the files a printer takes."""

from rig.build.wedges.files import (
    bracket_3mf,
    bracket_stl,
)
from rig.build.wedges.recipe import PrintPart
from rig.build.wedges.solid import (
    bracket_mesh,
    overhang_deg,
    print_part,
    wedge_corners_mm,
)
from rig.build.wedges.step import bracket_step

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
