"""Writes the API's document.

``python -m service.reference.openapi docs/reference/openapi.json``
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from service.api.app import make_app


def main() -> None:
    """Write the OpenAPI document to the path that is given."""
    text = json.dumps(make_app().openapi(), indent=1, sort_keys=True)
    Path(sys.argv[1]).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
