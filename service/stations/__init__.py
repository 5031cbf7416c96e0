"""Rigs that stand: the stations this service owns, and what they are asked to do."""
