"""Rigid bodies in three dimensions by impulses: contact search, solvers, step, engine."""
