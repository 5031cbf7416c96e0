"""A design and its layout as files."""
