"""docs/diff.md: a mended servo, from two versions of an installed package, told as the page tells it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs import mended_servo
from tests.docs.mended_servo import PAGE, met


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where both archives are, made as the page says."""
    return mended_servo.told(tmp_path_factory.mktemp("story"))


@pytest.mark.slow
def test_the_page_shows_what_is_said(folder: Path) -> None:
    [(_, shown)] = PAGE.shown
    said = met(folder, "diff", "before.h5", "after.h5", status=1)
    assert "".join(line for line in said.splitlines(keepends=True) if "MET's commit" not in line) == shown


@pytest.mark.slow
def test_the_mended_servo_stops_at_once(folder: Path) -> None:
    import numpy as np

    import batch
    from batch.differences.result import RequirementDiff

    found = batch.diff(folder / "before.h5", folder / "after.h5")
    assert found.verdict == "different" and not found.changed.meaning and not found.changed.decks
    [experiment] = found.experiments
    assert experiment.cases.count == 28 and not experiment.ended
    creep = "creep < 0.001 rad/s"
    assert experiment.requirements == [RequirementDiff(creep, creep, 20, 23, 3, 0)]
    before, after = (batch.open(folder / name).sel(recorded_case=27, joint="shoulder").qd for name in
                     ("before.h5", "after.h5"))  # fmt: skip
    at_rest = [float(qd.time[np.abs(qd) > 0.01][-1]) for qd in (before, after)]
    assert at_rest[0] - at_rest[1] > 2.0  # s


@pytest.mark.slow
def test_an_archive_that_is_run_again_by_the_same_version_is_identical(folder: Path) -> None:
    met(folder, "run", "after.h5", "--all", "-o", "again.h5", "-q", "--no-picture", status=1)
    met(folder, "diff", "after.h5", "again.h5", "--require", "identical", status=0)


def test_the_deck_with_tolerances_compiles(tmp_path: Path) -> None:
    import ic

    PAGE.put(tmp_path)
    [experiment] = ic.compile(tmp_path / "allowed.ic").experiments
    assert [each.of for each in experiment.tolerances] == ["qd", "elbow.q", "settle", "rel", "time"]


@pytest.mark.slow
def test_the_page_says_what_another_limit_makes_of_the_standard_sweep(tmp_path: Path) -> None:
    import batch
    import ic
    from batch.differences.words import verdict
    from ic.text.files import LIBRARY

    deck = (LIBRARY / "two_link.ic").read_text(encoding="utf-8")
    before, after = (tmp_path / name for name in ("before.h5", "after.h5"))
    for path, limit in ((before, "10 s"), (after, "1 s")):
        batch.run(
            ic.compile(text=deck.replace("require settle < 10 s", f"require settle < {limit}"), select=["gains"]),
            output=path,
        )
    assert f"\n{verdict(batch.diff(before, after))}\n" in PAGE.text
