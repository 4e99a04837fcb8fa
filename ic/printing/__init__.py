"""What the terminal shows of a deck, a plan and the models."""
