"""Sweeps: members of a grid of scenarios, what they share, and the processes that run them, here or on a cluster."""
