"""The sections of a rig file: one pydantic model each, and what each turns into."""
