"""Calibration floor: what measured image points say about points and cameras."""
