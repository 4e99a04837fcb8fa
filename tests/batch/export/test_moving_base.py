"""Arms on bases that move, shown: frames in a notebook and in an MCAP file are where the archive has the links."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.export import export
from met.diagnostic import Problem
from tests.batch.export.decks import Mcap
from tests.ic.small_decks import changed
from tests.met.program.free_flyers import ARM, RUN

LINKS = ("base", "upper", "lower")
RECORD = "record   = [q, links.base.position, links.base.orientation, links.upper.position, links.lower.position];\n}\n"
SHORT = RUN[: RUN.index("record   =")] + RECORD
STATE = SHORT[SHORT.index("        base.position") : SHORT.index("    }\n    environment")]
SHAKEN = changed(
    SHORT,
    (STATE, ""),
    (
        "base     = free;",
        """\
base     = prescribed {
        x   = sine(amplitude = 20 cm, frequency = 1 Hz);
        yaw = trapezoid(to = 50 deg, max_rate = 40 deg/s, max_acceleration = 60 deg/s^2);
    }""",
    ),
)
SWEEPS = {
    "free": (SHORT, "vary initial.base.rate.x = [0, 1] rad/s;"),
    "prescribed": (SHAKEN, "vary base.x.amplitude = [0, 0.3] m;"),
}


def made(folder: Path, text: str, axis: str = "") -> Path:
    deck = folder / "deck.ic"
    deck.write_text(ARM + text + (f"sweep some of tumbling {{ {axis} }}\n" if axis else ""), encoding="utf-8")
    archive = folder / "deck.h5"
    batch.run(ic.compile(deck, select=["some"] if axis else None), output=archive)
    return archive


@pytest.mark.slow
@pytest.mark.parametrize("kind", SWEEPS)
def test_frames_in_a_notebook_are_where_the_archive_has_the_links(tmp_path: Path, kind: str) -> None:
    with batch.open(made(tmp_path, *SWEEPS[kind])) as data:
        frames = data.met.frames()
        for link in LINKS:
            np.testing.assert_allclose(
                frames["position"].sel(link=link), data[f"links.{link}.position"], rtol=0, atol=1e-12
            )
        np.testing.assert_allclose(
            frames["orientation"].sel(link="base"), data["links.base.orientation"], rtol=0, atol=1e-12
        )
        one = data.isel(recorded_case=1, case=1).met.frames("lower")
        kept = data["links.lower.position"][1]
        np.testing.assert_allclose(one["position"].sel(link="lower"), kept, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SWEEPS)
def test_the_frames_of_an_export_move_with_the_base(tmp_path: Path, kind: str) -> None:
    archive = made(tmp_path, SWEEPS[kind][0])
    read = Mcap(export(archive).path)
    worlds = list(read.worlds("/tf"))
    assert set(worlds[0]) == set(LINKS)
    with ArchiveFile(archive) as file:
        for link in LINKS:
            found = np.array([world[link] for world in worlds])
            kept = file.groups[0].signal(f"links.{link}.position", 0)
            np.testing.assert_allclose(found[:, :3, 3], kept, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_a_free_base_that_was_not_recorded_is_told(tmp_path: Path) -> None:
    archive = made(tmp_path, changed(SHORT, (RECORD, "record = [q];\n}\n")))
    with pytest.raises(Problem) as caught:
        export(archive)
    (told,) = caught.value.diagnostics
    assert told.message == (
        "the arm of case #0 of `tumbling` cannot be shown: links.base.position, links.base.orientation was not recorded"
    )
    assert told.help[0] == (
        "`record = [q, links.base.position, links.base.orientation]` in the run keeps where its joints and its base "
        "are; then run it again"
    )
    with batch.open(archive) as data, pytest.raises(Problem) as caught:
        data.met.frames()
    assert caught.value.diagnostics[0].help == told.help[:1]


@pytest.mark.slow
def test_an_archive_says_that_its_base_moves(tmp_path: Path) -> None:
    with batch.open(made(tmp_path, SHORT)) as data:
        assert data.attrs["frame"].endswith("; the base is a link, which moves in the world")
