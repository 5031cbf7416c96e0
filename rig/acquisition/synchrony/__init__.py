"""Which picture belongs to which shot, and the proof that all were taken at one instant.

Pure reckoning on what devices gave: nothing here opens a device or a file.
"""
