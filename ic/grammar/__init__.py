"""Tokens -> syntax tree: the entries as written, in the order written."""
