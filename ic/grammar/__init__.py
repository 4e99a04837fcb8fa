"""Tokens -> syntax tree: what was written, in the order written."""
