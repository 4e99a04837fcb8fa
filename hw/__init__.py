"""Hardware in the loop: one joint's motor real. Nothing stands here yet; the room is kept so that its walls are."""
