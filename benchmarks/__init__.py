"""Measurements that the documentation quotes. Each module is a command."""

import sys
from pathlib import Path

# Scenes and rigs with a known truth live with the tests, and are measured here.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
