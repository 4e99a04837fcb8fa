"""The verdict of very many cases is counted as they are merged; their archive is not read for it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from batch.terminal import running
from tests.batch.foreign.archives import met

DECK = """
#include <two_link.ic>
run short like nominal { duration = 4 s;  require quick: settle < 3 s;  require calm: volts < 0.9 V; }
sweep some of short { vary gearbox.kp = linspace(0.01, 0.03, 12) V*s/rad; }
sweep wild of short { vary gearbox.kp = [0.01, 0.02, 1e300] V*s/rad; }
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(DECK, encoding="utf-8")
    return tmp_path


@pytest.mark.release
@pytest.mark.parametrize("sweep", ["some", "wild"])
def test_the_verdict_is_that_of_an_archive_that_is_read(
    sweep: str, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("run", "deck.ic", sweep, "--no-picture", "--verify", "none", "--format", "json")
    read = met(*words, "-o", "a.h5")
    monkeypatch.setattr(running, "MOST_READ", 2)
    counted = met(*words, "-o", "b.h5")
    assert read.status == counted.status == 1
    assert Path("a.h5").read_bytes() == Path("b.h5").read_bytes()
    one, two = (json.loads(said.text)["experiments"][0] for said in (read, counted))
    for name in ("name", "cases", "failed", "recorded", "requirements", "ok"):
        assert one[name] == two[name]
    assert one["metrics"] and not two["metrics"]


@pytest.mark.slow
def test_it_says_where_the_rest_is(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "MOST_READ", 2)
    said = met("run", "deck.ic", "some", "-o", "a.h5")
    assert said.status == 1
    assert (
        "picture  none: of more than 2 cases `met show` says more and `met plot` draws: 150 MB of memory a million"
    ) in said.text
    assert "exit 1: not met everywhere: " in said.text
    again = met("run", "deck.ic", "some", "-o", "a.h5")  # nothing is run, so it is read
    assert "nothing is missing" in again.text and again.status == 1
