"""The ground floor: frames, cameras, optics, scans and ray casting.

Imports none of the other floors. Millimetres and degrees at every boundary; the
conventions are stated in :mod:`geometry.frames` and in ``docs/reference/conventions.md``.
"""
