"""Tests of the Python package, run by the environment that its wheel is installed in (scripts/python.sh)."""
