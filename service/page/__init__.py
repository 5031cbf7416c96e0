"""The page that a browser gets from the service: for whoever stands in front of the subject.

It is a guest like every other program: all it knows and does goes through ``/v1``.
"""
