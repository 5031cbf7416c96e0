"""Blender as a second photographer of the simulated scene, in a program of its own."""
