"""Checks of a whole run or deck, most of which warn: models that do nothing, steps that are too long."""
