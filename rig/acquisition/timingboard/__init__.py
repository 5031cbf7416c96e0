"""The LED timing board: what it is, and the time that a picture of it shows."""
