"""Hardware in the loop: one joint's motor real."""
