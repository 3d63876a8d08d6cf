"""The laboratory: figures (measurements, stored with commit and machine), tables of the documentation, and training.

`scripts/lab.sh FIGURE` runs a figure, with the folders of the other scripts on the search path of modules.
"""
