"""Plays the cases; scripts/hard-cases.sh runs it."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import run  # noqa: E402

if __name__ == "__main__":
    sys.exit(run.main())
