"""A serial line or what stands for one, and transcripts of what went over a line."""
