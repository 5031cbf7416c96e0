"""A session on disk: what is written, in which order, and what a crash can leave.

Knows nothing of devices: it is given pictures and findings, and keeps them whole.
"""
