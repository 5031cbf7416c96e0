"""Measurements that the documentation quotes. Each module is a command."""
