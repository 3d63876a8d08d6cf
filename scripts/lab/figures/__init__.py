"""The figures: a module each, with a function `main`. See lab/__main__.py."""
