"""What runs in a process of its own for the service or a command.

The one place, with :mod:`service.stations`, where the service has geometry, solver, rig and
calibration work. Each task is called with a :class:`service.jobs.engine.Task` and what it needs
while it runs, and returns its kind's result.
"""
