"""What `met plan`, `met explain` and `met doc` print of guides."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ic.printing.plan import print_plan
from met import cli
from tests.ic.small_decks import check, messages
from tests.met.plan.test_plan_guides import DECK


def test_a_plan_shows_guides_with_their_joints_and_paths(tmp_path: Path) -> None:
    compiled = check(tmp_path, DECK)
    assert compiled.plan is not None, messages(compiled)
    text = "\n".join(print_plan(compiled.plan))
    assert (
        """\
Guides: each commands the joints that follow it
  tip   resolved_rate  link = two, point = [1, 0, 0] m, guides = xy, max_damping = 0.1 m, threshold = 0.2 m, gain = 1 1/s, length = 1 m, loop = closed, jacobian = arm
        low            max_rate = inf rad/s
        high           max_rate = inf rad/s
        x              table, times = 2 numbers, values = 2 numbers
        y              ramp, start = 0 m, to = 0.01 m, begin = 0 s, over = 1 s
  move  together       begin = 0 s
        out            to = 0.01 m, max_rate = 0.01 m/s, max_acceleration = 0.01 m/s^2

"""
        in text
    )
    assert re.search(r"^  guide tip of low, high +500 Hz  every 2 ticks +501 ticks$", text, re.MULTILINE)
    assert "follow (ideal): rate, tip\n" in text


EXPLAINED = [
    (
        "guides.tip.gain",
        """\
guides.tip.gain = 1 1/s
  gain of the guide: rate per path error (resolved_rate)
  the default
""",
    ),
    (
        "tip.high.max_rate",
        """\
guides.tip.high.max_rate = inf rad/s
  largest rate (resolved_rate)
  the default
""",
    ),
    (
        "guides.tip.y.over",
        """\
guides.tip.y.over = 1 s
  duration of the ramp (ramp)
  --> deck.ic:16:86
   |
""",
    ),
    (
        "guides.tip.rate",
        """\
guides.tip.rate = 500 Hz
  computed: 2 base ticks a tick
""",
    ),
]


@pytest.mark.parametrize(("path", "expected"), EXPLAINED)
def test_explain_says_where_a_guides_numbers_come_from(
    path: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(DECK, encoding="utf-8")
    assert cli.main(["explain", "deck.ic", path]) == 0
    assert capsys.readouterr().out.startswith(expected)


def test_doc_says_what_a_guide_gives(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doc", "guide", "resolved_rate"]) == 0
    text = capsys.readouterr().out
    assert "Kinds of command that it gives: rate, position" in text
    assert "Outputs of the guide, updated at each of its ticks; recorded as guides.NAME.NAME" in text
    assert "for each joint: largest rate" in text
