"""Coded targets: what is printed and stood up, as files, as drawings and as a proposal."""
