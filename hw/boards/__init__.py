"""The firmware of a bed, built for a board: images, the interlock as it counts, and a Pico with its bench."""
