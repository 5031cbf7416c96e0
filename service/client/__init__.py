"""A service that runs, asked over HTTP by the command line: how it is found, what its rig does."""
