"""Stores the JSON object on stdin as the figure named by the first argument."""

import json
import sys

from record import record

record(sys.argv[1], json.load(sys.stdin))
