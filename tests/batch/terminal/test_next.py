"""The last lines of `met run` lead on from what was run, not from what the deck says by itself."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import batch
from tests.batch.foreign.archives import met

DECK = """
#include <two_link.ic>
#ifndef SECONDS
#define SECONDS 4
#endif
run short like nominal { duration = SECONDS * 1 s; }
sweep some of short { vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad; }
"""


@pytest.mark.slow
def test_the_case_that_it_offers_to_run_again_is_one_of_the_archive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(DECK, encoding="utf-8")
    words = ("-o", "a b.h5", "--histories", "none", "--no-picture", "-D", "SECONDS=6", "--set", "gearbox.ki=0.2 V/rad")
    said = met("run", "deck.ic", "some", *words)
    [command] = re.findall(r"^ +met (run .*)$", said.text, re.MULTILINE)
    archive, case = shlex.split(command)[1::2]
    assert archive == "a b.h5"
    assert met(*shlex.split(command), "-o", "again.h5", "--no-picture").status == said.status
    again, first = batch.open("again.h5"), batch.open("a b.h5").isel(case=int(case[1:]))
    assert (again["settle"].item(), again["case_id"].item()) == (first["settle"].item(), first["case_id"].item())
