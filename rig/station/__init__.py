"""The station: which trigger box, cameras and lights stand on the bench, and how they are used.

:mod:`rig.station.stationfile` reads it from a file, :mod:`rig.capture` works with it.
"""
