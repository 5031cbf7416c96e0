"""The station: which trigger box, cameras and lights stand on the bench, and how they are used.

:mod:`.stationfile` reads it from a file, :mod:`rig.acquisition.capture` works with it.
"""
