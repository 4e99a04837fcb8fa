"""Decks and models that run as they are, to begin from: the files that `met new` writes."""
