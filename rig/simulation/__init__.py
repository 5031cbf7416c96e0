"""The simulated studio: a textured head, lights, targets and cameras that photograph them.

:mod:`rig.simulation.settings` says what stands in it, :class:`rig.simulation.studio.Studio`
photographs it, :mod:`rig.simulation.backend` is the camera that the rest of Rigwright sees.
"""
