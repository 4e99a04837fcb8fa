"""Runs resolved, each to an experiment of a plan."""
