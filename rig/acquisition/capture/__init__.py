"""A station in operation: devices opened, armed, fired, and their pictures collected.

:mod:`rig.acquisition.synchrony` judges what came, :mod:`rig.acquisition.session` files it.
"""
