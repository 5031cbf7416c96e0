"""How a structure gives way under its own weight and a touch, and whether that is little enough."""
