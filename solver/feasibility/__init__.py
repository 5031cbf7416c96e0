"""Limits that no rig can hold, told before anything is searched."""
