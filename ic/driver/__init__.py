"""What commands ask of the compiler: a deck compiled, a value explained, the deck of a URDF file."""
