"""The codes of warnings that a run may allow, as by `allow D105 because "the paper's own rates";`."""

from __future__ import annotations

WHILE_RUNNING: frozenset[str] = frozenset({
    "D310", "D311", "D312", "D317", "D318", "D319", "D320", "D321", "D322", "D329", "D341", "D344", "D345", "D347",
    "D348",
})  # fmt: skip
"""Codes of warnings that only a run may give: the check cannot know whether an `allow` of one is of use."""

WARNINGS = WHILE_RUNNING | {
    "D003", "D015", "D017", "D036", "D037",
    "D102", "D105", "D127", "D138", "D167", "D168", "D169",
    "D210", "D211", "D218", "D219", "D228", "D248", "D249", "D252", "D256", "D257", "D267", "D268", "D287", "D290",
    "D293", "D294", "D295", "D296", "D297", "D298", "D300", "D301", "D305", "D306", "D307",
    "D334", "D335", "D336", "D337", "D338", "D339", "D340", "D341", "D342", "D349", "D352", "D366", "D385", "D386",
    "D387", "D388", "D389", "D392",
}  # fmt: skip
"""Every code of a warning about a run or its deck, except that of an `allow` that silences nothing. Some are also codes
of errors. tests/met/messages/test_warning_codes.py checks the list against the source."""
