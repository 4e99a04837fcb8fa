"""Definitions of a deck, by kind and name, merged with their bases; and the number files that they name."""
