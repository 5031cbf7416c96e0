"""Pages of reconstructions and comparisons: pictures from three sides, figures, tables."""
