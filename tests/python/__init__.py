"""Tests of the program from outside, run by scripts/test.sh.

`test_*.py` run in .venv (numpy, OpenEXR, flip-evaluator), `usd_*.py` in .venv-usd (usd-core, numpy, OpenEXR),
`blender_*.py` in .venv-bpy (bpy, numpy). All find the program and scratch space through `support`; those of the add-on
install it through `addon`, which reads EXR files with the OpenEXR of .venv.
"""
