"""Start values: interiors, poses of cameras and carriers, unknown targets, from images alone."""
