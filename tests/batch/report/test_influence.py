"""The part of a page that says which parameters matter: the numbers of `met sensitivity`, with a tornado."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.pool import pools
from batch.queries.sensitivity import sensitivities, share_text
from batch.report import report
from batch.report.contents.tables import influences

DECK = """
#include <two_link.ic>
run brief like nominal { rates { dynamics = 100 Hz; servos = 100 Hz; record = 20 Hz; } duration = 5 s; record = []; }
sweep drawn of brief {
    sample random(COUNT) { gearbox.kp = uniform(0.015, 0.025) V*s/rad; gearbox.ki = uniform(0.05, 0.125) V/rad; }
}
sweep single of brief { vary gearbox.kp = linspace(0.015, 0.025, 80) V*s/rad; }
sweep few of brief { vary gearbox.kp = [0.015, 0.025] V*s/rad; vary gearbox.ki = [0.1, 0.125] V/rad; }
"""


def made(folder: Path, sweep: str, count: int = 100) -> Path:
    plan = ic.compile(text=DECK.replace("COUNT", str(count)), select=[sweep])
    return batch.run(plan, output=folder / "a.h5", histories="none").path


@pytest.mark.slow
def test_the_parts_are_what_met_sensitivity_says(tmp_path: Path) -> None:
    with ArchiveFile(made(tmp_path, "drawn")) as file:
        parts = {each.metric: each for each in influences(pools(file.groups)[0])}
        told = {each.name: each for each in sensitivities(file.groups[0])}
    assert list(parts) == ["settle", "volts"], "something is required of the first"
    for name, part in parts.items():
        one = told[name]
        assert [row.path for row in part.rows] == [one.inputs[place] for place in one.order]
        for row, place in zip(part.rows, one.order, strict=True):
            share = one.shares[place]
            assert row.alone == share_text(share.first, share.first_by)
            assert (row.low, row.high) == (share.low / one.scale, share.high / one.scale)


@pytest.mark.slow
def test_the_bars_of_a_tornado_go_from_the_mean_to_both_ends(tmp_path: Path) -> None:
    archive = made(tmp_path, "drawn")
    page = report(archive, tmp_path / "a.html").read_text(encoding="utf-8")
    with ArchiveFile(archive) as file:
        parts = influences(pools(file.groups)[0])
    tornados = re.findall(r'<svg class="tornado".*?</svg>', page)
    rows = [(row, part.mean) for part in parts for row in part.rows]
    assert len(tornados) == len(rows) == 4
    for drawn, (row, mean) in zip(tornados, rows, strict=True):
        ((x, width), (other, wide)) = (
            (float(x), float(w)) for x, w in re.findall(r'x="([\d.]+)" y="3" width="([\d.]+)"', drawn)
        )
        [middle] = map(float, re.findall(r'x1="([\d.]+)"', drawn))
        for x_, width_, value in ((x, width, row.low), (other, wide, row.high)):
            assert x_ == pytest.approx(middle if value > mean else middle - width_, abs=0.02)
        if row.low != row.high:
            assert width / wide == pytest.approx(abs(row.low - mean) / abs(row.high - mean), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("sweep", "count", "said"), [
    ("drawn", 40, ["Not enough cases to tell: 40; 64 at least."]), ("single", 0, []), ("few", 0, []),
])  # fmt: skip
def test_where_nothing_can_be_told_there_is_no_table(tmp_path: Path, sweep: str, count: int, said: list[str]) -> None:
    with ArchiveFile(made(tmp_path, sweep, count or 1)) as file:
        parts = influences(pools(file.groups)[0])
    assert [part.summary for part in parts] == said and not any(part.rows for part in parts)
