"""Training of the network that combines the levels; see README.md."""
