"""What a lab asks for: the rig file, read and checked."""
