"""Cameras behind one small interface, :mod:`.base`; one module per way to reach them."""
