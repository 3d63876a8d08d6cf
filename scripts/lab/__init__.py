"""What only measures: figures with their commits and machines, the tables of the documentation, training.

`scripts/lab.sh FIGURE` runs a figure; it puts the folders of the other scripts on the search path of modules.
"""
