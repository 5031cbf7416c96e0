"""A trigger box made of nothing: the protocol's fake, the ESPER fake, and their lines.

They stand in for hardware in tests, in demonstrations and for whoever writes a driver; a
configuration names their line like any other, no code asks whether a box is real.
"""
