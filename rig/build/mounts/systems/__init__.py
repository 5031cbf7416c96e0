"""Mount systems: T-slot frame, flat plate, arc and tripods, behind one interface."""
