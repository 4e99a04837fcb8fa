"""Definitions of a deck, by kind and name, merged with what they are like; and the files of numbers that they name."""
