"""Decks, plans and models as the terminal shows them."""
