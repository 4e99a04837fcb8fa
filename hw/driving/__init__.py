"""Beds driven in real time: a case, the loop, its pace and timing, and the process that it runs in."""
