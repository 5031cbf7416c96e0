"""What the documentation says of answers, in OpenAPI's own words."""

from __future__ import annotations

from typing import Any

Responses = dict[int | str, dict[str, Any]]
"""By status: what FastAPI takes as ``responses``."""

BINARY = {"type": "string", "format": "binary"}
"""The schema of a file."""


def a_file(*media_types: str, description: str = "The file.") -> Responses:
    """An answer that is a file, of one of the media types."""
    content = {
        name: {"schema": {"type": "object"} if name == "application/json" else BINARY}
        for name in media_types
    }
    return {200: {"description": description, "content": content}}
