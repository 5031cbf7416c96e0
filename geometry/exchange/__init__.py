"""Camera poses and intrinsics for other programs.

``export_files("colmap-text", cameras)`` gives file contents by name, ``write_export`` puts them in
a folder, ``FORMATS`` lists what there is. The cameras are :class:`geometry.camera.RigCamera`,
designed or calibrated; ``docs/how-to/exports.md`` states what each program expects.
"""

from geometry.exchange.base import ExportOptions, Format, image_name, image_stem
from geometry.exchange.registry import FORMATS, export_files, find_format, write_export

__all__ = [
    "FORMATS",
    "ExportOptions",
    "Format",
    "export_files",
    "find_format",
    "image_name",
    "image_stem",
    "write_export",
]
