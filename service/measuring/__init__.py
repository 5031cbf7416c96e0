"""From pictures of targets to calibrations, checks and acceptance tests, with their files."""
