"""What `met status` says of a whole archive, and to who names something else."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
from met.cli import main
from tests.batch import plans

REST = """\
 = help: `met run DECK -o ARCHIVE` begins one; its folder is beside the archive until that is whole

1 error
"""


@pytest.mark.usefixtures("engine")
def test_a_single_case_is_one_case(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    batch.run(plans.plan(), output="a.h5")
    assert main(["status", "a.h5"]) == 0
    assert capsys.readouterr().out.startswith("a.h5 is whole: 1 case, begun at ")


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_who_names_the_deck_is_told_of_its_archives(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    batch.run(plans.plan(), output="two.h5")
    batch.run(plans.plan(plans.gains(2)), output="two.gains.h5")
    capsys.readouterr()
    for name in ("two.ic", "two"):
        assert main(["status", name]) == 2
        assert capsys.readouterr().err == (
            f"error[E359]: no campaign fills {name}\n = help: a status is of an archive; here: two.gains.h5, two.h5\n"
            f"{REST}"
        )
    assert main(["status", "other.h5"]) == 2
    assert capsys.readouterr().err == f"error[E359]: no campaign fills other.h5\n{REST}"


def test_who_shows_a_deck_is_told_what_makes_an_archive_of_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "two_link.ic"]) == 2
    assert capsys.readouterr().err == (
        "error[E301]: cannot read the archive two_link.ic: no such file or directory\n"
        " = help: `met run two_link.ic` writes one\n\n1 error\n"
    )
