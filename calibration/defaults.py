"""What calibrations, checks and acceptance tests take where nothing is said: each figure once."""

from __future__ import annotations

TOLERANCE_MM = 0.02
"""Smaller effects at the subject turn no light red. A face needs 0.05 mm at most."""

HIDDEN_LIMIT_MM = 0.1
"""A camera that could hide a larger effect is not called fine."""

LENGTH_LIMIT = (20.0, 50.0, 50.0)
"""Largest error of a length L, A + K L and at most B: micrometres, micrometres per metre."""

VOLUME_MM = (200.0, 200.0, 100.0)
"""Width, height and depth that are measured in: those of a face from ear to ear. Two thirds of its
diagonal, the longest length that a test needs, are 200 mm."""
