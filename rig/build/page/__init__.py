"""A mount plan as a page and as a scene."""
