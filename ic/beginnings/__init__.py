"""Decks and models that run unchanged, as starting points: the files that `met new` writes."""
