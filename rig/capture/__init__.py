"""A station in operation: devices opened, armed, fired, and their pictures collected.

:mod:`rig.synchrony` judges what came, :mod:`rig.session` files it.
"""
