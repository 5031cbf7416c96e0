"""Processes that hold one camera each.

What stands here may run under another Python than the rest (Aravis comes with the system's),
so it imports the standard library, :mod:`common.errors` and the camera's own library, no more.
"""
