"""Differences between two campaigns, for `met diff A B`.

matching     which experiment, case, signal of one is which of the other
tolerance    how much may differ, by signal; nothing unless it is given
compare      two histories, or two columns of metrics: identical, equivalent, different, and where
campaigns    all of two archives, in bounded memory;  result: what comes of it
demands      which requirements are others, and which cases meet them
provenance   what made them: parameters, models, decks, versions
samples      metrics as distributions, where single cases cannot be compared
words        what is found in words, part by part;  text, data: all of it for people, and for programs
"""

from __future__ import annotations
