"""What `met run`, `show`, `profile` and `margin` say in a terminal."""
