"""What is fired: cameras, trigger box, station, captures, sessions, their evidence."""
