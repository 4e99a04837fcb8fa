"""The compiler's commands: a deck compiled, a value explained, the deck of a URDF file."""
