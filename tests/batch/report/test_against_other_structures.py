"""`met report --against` an archive of another structure: what has no counterpart is told, and nothing is paired that
is not the same."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest

from met import cli

DECK = """\
arm crane {
    link cart { mass = 1200 g; shape = box(size = [100, 100, 100] mm); }
    link boom { mass = 1 kg; shape = cylinder(radius = 2 cm, length = 500 mm, along = x); }
    joint slide prismatic { parent = base; child = cart; axis = x; }
    joint turn  revolute  { parent = cart; child = boom; axis = z; }
}
run it {
    arm = crane;  initial { slide.qd = 0.5 m/s;  turn.q = 20 deg; }
    rates { dynamics = 100 Hz; record = 50 Hz; }  duration = 0.5 s;  record = [q, qd];
    metric far = final { of = slide.q; }   require far < 70 cm;
    metric low = min   { of = turn.q; }    require low > -21 deg;
}
sweep cranes of it { vary links.cart.mass = [900, 2000] g; }
"""

OTHERS = {
    "joints": (("turn", "swing"), ("joint swing is gone", "joint turn is new", "metric low: of swing.q -> turn.q",
                                   "q incomparable", "qd incomparable", "far identical 2")),
    "channels": (("record = [q, qd]", "record = [q, qdd, tau]"),
                 ("qd incomparable only in now.h5", "qdd incomparable only in before.h5",
                  "tau incomparable only in before.h5", "q identical 2")),
    "cases": (("[900, 2000] g", "[1000, 1500, 2000] g"),
              ("1 case only in now.h5", "2 cases only in before.h5", "cranes: 1 case in both", "q identical 1")),
    "paths": (("links.cart.mass", "links.boom.mass"), ("The two have no case in common.", "far incomparable no case")),
    "metrics": (("metric far = final { of = slide.q; }   require far < 70 cm;", ""),
                ("far < 70 cm is only in now.h5, met by 2 of 2", "far incomparable only in now.h5")),
    "structures": (("2000] g;", "2000] g; vary integrator = [modified_euler, rk4];"),
                   ("cranes.modified_euler is only in before.h5", "cranes.rk4 is only in before.h5",
                    "cranes is only in now.h5", "The two have no case in common.")),
    "rates": (("record = 50 Hz", "record = 20 Hz"), ("rates.record: 20 Hz -> 50 Hz", "q identical 2")),
    "names": (("cranes", "cranks"), ("cranks and cranes: 2 cases in both, identical",)),
}  # fmt: skip


def archive(path: Path, text: str, *names: str) -> Path:
    path.with_suffix(".ic").write_text(text, encoding="utf-8")
    words = ["run", path.with_suffix(".ic"), *names, "-q", "--no-picture", "-o", path]
    assert cli.main([str(word) for word in words]) in (cli.YES, cli.NO)
    return path


def told(now: Path, before: Path) -> str:
    """The text of the report."""
    page = now.with_suffix(".html")
    assert cli.main(["report", str(now), "--against", str(before), "-q", "-o", str(page)]) in (cli.YES, cli.NO)
    text = re.sub(r"<(script|style).*?</\1>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", text)))


@pytest.mark.release
@pytest.mark.parametrize("kind", OTHERS)
def test_what_has_no_counterpart_is_told(kind: str, tmp_path: Path) -> None:
    (old, new), words = OTHERS[kind]
    assert old in DECK
    now = archive(tmp_path / "now.h5", DECK, "cranes")
    before = archive(tmp_path / "before.h5", DECK.replace(old, new), "cranks" if kind == "names" else "cranes")
    text = told(now, before)
    for each in words:
        assert each in text, each


@pytest.mark.release
def test_a_run_that_only_one_of_them_has_is_told(tmp_path: Path) -> None:
    now, before = archive(tmp_path / "now.h5", DECK, "it", "cranes"), archive(tmp_path / "before.h5", DECK, "it")
    assert "cranes is only in now.h5" in told(now, before)
    assert "cranes is only in now.h5" in told(before, now)
