"""What `met new` writes: decks and models that run as they are, to begin from."""
