"""Cameras behind one small interface, :mod:`rig.cameras.base`; one module per way to reach them."""
