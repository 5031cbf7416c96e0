"""What each kind of job is asked with and what comes of it: one request and one result model.

Command line, HTTP, store, task and tables all hand on these objects.
"""
