"""Tests of the program from outside, run by scripts/test.sh.

`test_*.py` run in .venv (numpy, OpenEXR, flip-evaluator), `blender_*.py` in .venv-bpy (bpy, numpy). Both find the
program and scratch space through `support`; those of the add-on install it through `addon`, which reads EXR files with
the OpenEXR of .venv.
"""
