"""Runs the cases; tests/hard-cases.sh calls it."""

import sys

from . import run

sys.exit(run.main())
