"""Camera bodies and views as solids in space."""
