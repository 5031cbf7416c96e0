"""One file a command: its options, and what it does. Heavy imports stand in the functions."""
