"""The base, bodies that move freely, payloads; and the world as environment models see it."""
