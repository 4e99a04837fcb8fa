"""Beds, one a file: over a serial line, in this process, and from the transcript of one that was."""
