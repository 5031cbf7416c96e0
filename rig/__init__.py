"""What is built: rig files in; design files, mount layouts, scenes and reports out.

Uses designs, never makes them. The only floor besides ``service`` that reads and writes
files of its own; pydantic models stand at those edges and nowhere else.
"""
