"""Logs of measured signals, as the channels of a run.

log          a CSV or MCAP file, by the channels that a run records
mcap_log     MCAP files
"""
