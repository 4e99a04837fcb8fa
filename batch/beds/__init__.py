"""Campaigns on motor beds: `met bed run`, whose cases are driven one after another in real time.

    executor   carries out a campaign's tasks, each case in a process of its own (hw/case.py)
    records    what was said and answered, made into shards: at the end of a case, or after a crash
"""

from __future__ import annotations
