"""Comparison of a cloud with a reference surface: signed distances, completeness, figures."""
