"""Mount systems: what holds the cameras of a design, and how each is set by hand."""
