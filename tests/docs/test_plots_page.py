"""docs/plots.md: its commands draw, its pictures are theirs, and what it says is what the code says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from batch.plotting import histories, layout, output, points, requests, sides
from batch.queries import grids
from met import cli
from tests.batch.plotting import figures
from tests.batch.plotting.figures import PAGE


@pytest.mark.release
def test_the_commands_draw_what_they_name(tmp_path: Path) -> None:
    drawn = figures.run(tmp_path)
    assert {Path(name).suffix for name in drawn} == set(output.METADATA)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in drawn)
    shown = set(re.findall(r"figures/(plot_\w+\.png)", PAGE))
    assert shown == {name for name in drawn if name.startswith("plot_")}
    assert shown == {path.name for path in figures.FOLDER.glob("plot_*.png")}


def test_the_options_are_those_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plot", "--help"]) == cli.YES
    told = set(re.findall(r"--[a-z]+", capsys.readouterr().out))
    named = set(re.findall(r"`(--[a-z]+)", PAGE)) | {"--output"}
    assert told - named == {"--run", "--quiet", "--verbose", "--help"} and named <= told


def test_the_limits_are_those_of_the_code() -> None:
    assert (requests.MAPPED, requests.MOST_BESIDE, histories.OVERLAID) == (5, 6, 8)
    for said in (
        f"than {sides.MOST_CELLS} values", f"than {grids.MOST_LEVELS} values",
        f"up to {requests.MOST_BESIDE} values", f"than {points.RASTERED:,} points",
        f"{layout.SCREEN_DPI}, with `--size` {layout.PAPER_DPI}",
    ):  # fmt: skip
        assert said in PAGE
