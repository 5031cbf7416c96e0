"""Finding the face of a scan by its shape, in any pose, at any scale."""
