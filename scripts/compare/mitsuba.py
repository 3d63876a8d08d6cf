#!/usr/bin/env python3
"""Compares with Mitsuba, and translates scenes to it and from it: `scripts/compare/mitsuba.py --help`.

Runs scripts/compare/peers in .venv-compare, which it makes (setup.sh).
"""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
PYTHON = HERE.parents[1] / ".venv-compare" / "bin" / "python"

if __name__ == "__main__":
    subprocess.run(["bash", HERE / "setup.sh"], check=True)
    os.execv(PYTHON, [str(PYTHON), str(HERE / "peers"), *sys.argv[1:]])
