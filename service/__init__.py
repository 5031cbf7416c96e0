"""The door to Rigwright: REST service, command line, jobs, storage. Computes nothing itself."""
