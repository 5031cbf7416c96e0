"""Drawings of a mount plan: views, plates, templates and setting sheets, as DXF, SVG and PDF."""

from rig.build.drawings.checksheet import check_sheets, checks_csv
from rig.build.drawings.dxf import dxf_bytes
from rig.build.drawings.exploded import exploded_sheets
from rig.build.drawings.isometric import isometric_sheets
from rig.build.drawings.items import Sheet
from rig.build.drawings.lists import poses_csv, settings_csv, tapes_csv
from rig.build.drawings.pdf import pdf_bytes
from rig.build.drawings.plates import plate_sheets
from rig.build.drawings.settingsheet import setting_sheets
from rig.build.drawings.steps import plain_steps, steps_text
from rig.build.drawings.svg import svg_bytes
from rig.build.drawings.templates import template_pages, template_sheet
from rig.build.drawings.views import view_sheets

__all__ = [
    "check_sheets",
    "checks_csv",
    "exploded_sheets",
    "isometric_sheets",
    "Sheet",
    "dxf_bytes",
    "pdf_bytes",
    "plain_steps",
    "plate_sheets",
    "poses_csv",
    "setting_sheets",
    "settings_csv",
    "steps_text",
    "svg_bytes",
    "tapes_csv",
    "template_pages",
    "template_sheet",
    "view_sheets",
]
