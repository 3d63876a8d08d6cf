#!/usr/bin/env python3
"""Compares caustique with Mitsuba, and converts scenes between both: `scripts/compare/mitsuba.py --help`.

Runs scripts/compare/peers in .venv-compare, which setup.sh creates if necessary.
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
