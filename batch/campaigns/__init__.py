"""Campaigns: what is run, in which tasks, into which folder, and how it goes on and ends."""
