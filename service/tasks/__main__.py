"""``python -m service.tasks``: the process of one task."""

from __future__ import annotations

import sys

from service.jobs.child import main
from service.tasks.registry import work_of

if __name__ == "__main__":
    sys.exit(main(work_of))
