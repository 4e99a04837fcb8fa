"""Decks, plans and models as text for the terminal."""
