"""Campaigns: their cases, tasks and folders, and their progress from start to end."""
