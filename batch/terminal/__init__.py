"""Text output of `met run`, `show`, `profile` and `margin` in a terminal."""
