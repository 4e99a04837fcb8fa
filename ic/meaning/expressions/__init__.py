"""Expressions to quantities in SI, the names in them, and conditions on their values."""
