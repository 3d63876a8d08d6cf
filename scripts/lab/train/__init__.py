"""Training of the network that combines the levels (README.md)."""
