"""A capture from start to commit: arm, fire, collect, pair, prove, write.

:func:`rig.capture.rig.open_station` is the way in; ``docs/capture.md`` tells the whole.
"""
