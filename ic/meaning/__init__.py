"""Syntax tree -> plan: what is meant, in SI, with the origin of every value."""
