"""The entries of tasks: what runs in a process of its own for the service or a command.

Each is called as ``function(request, inputs, folder, report, cancel)`` and returns a JSON object.
"""
