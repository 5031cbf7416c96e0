"""Pictures to find targets in: in a folder, in an archive, or in a session."""
