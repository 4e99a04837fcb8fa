"""Logs of measured signals, as the channels of a run, and their residuals.

log          a CSV or MCAP file, by the channels that a run records
mcap_log     MCAP files
residuals    what was measured less what a run computed, and what that follows
"""
