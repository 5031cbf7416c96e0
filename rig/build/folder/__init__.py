"""The plan folder: every file of a mount plan, written whole or not at all."""
