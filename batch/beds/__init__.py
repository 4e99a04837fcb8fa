"""Motor beds at work: `met bed run`, whose cases are driven one after another in real time, and what is asked of a bed
before.

    running    `met bed run`
    executor   carries out a campaign's tasks, each case in a process of its own (hw/case.py)
    made       what was said and answered, made into shards: at the end of a case, or after a crash
    telling    how far a case is, and how well the loop kept its time
    asking     which bed a user means, of `probe` and `jitter`
    probe      `met bed probe`: who is there
    jitter     `met bed jitter`: how well exchanges keep their time (hw/jitter.py)
"""

from __future__ import annotations
