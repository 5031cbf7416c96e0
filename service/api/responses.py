"""What the documentation says of answers, in OpenAPI's own words."""

from __future__ import annotations

from typing import Any

Responses = dict[int | str, dict[str, Any]]
"""By status: what FastAPI takes as ``responses``."""
