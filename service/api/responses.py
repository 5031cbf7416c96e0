"""What the documentation says of answers, in OpenAPI's own words."""

from __future__ import annotations

from typing import Any

Responses = dict[int | str, dict[str, Any]]
"""By status: what FastAPI takes as ``responses``."""

BINARY = {"type": "string", "format": "binary"}
"""The schema of a file."""


def a_file(media_type: str, description: str = "The file.") -> Responses:
    """An answer that is a file."""
    schema = {"type": "object"} if media_type == "application/json" else BINARY
    return {200: {"description": description, "content": {media_type: {"schema": schema}}}}
