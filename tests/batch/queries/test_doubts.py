"""Cases that are done and doubtful are told: in the archive, in what a run prints, its JSON, a report and a log."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.export.case_log import log_lines
from batch.export.picking import ExportedCase
from batch.queries.pool import Pool
from batch.report.contents.verdicts import verdict
from met.cli import main

DECK = """
arm rail {
    link cart { mass = 1 kg; shape = box(size = [0.1, 0.1, 0.1] m); }
    joint slide prismatic { parent = base; child = cart; axis = x; }
}
run one {
    arm = rail;  initial { slide.qd = 1 m/s; }
    environment { drag = joint_damping { sliding = 10 N*s/m; } }
    rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 800 ms;
    record = [qd];  metric late = final { of = slide.qd; }
}
sweep some of one { vary environment.drag.sliding = [10, 220, 20, 221, 300] N*s/m; }
"""
"""Damping of 200 N s/m is the most that the step follows: cases 1 and 3 pass 1e6 m/s, and case 4 1e9."""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("doubts")
    (folder / "cart.ic").write_text(DECK, encoding="utf-8")
    assert main(["run", str(folder / "cart.ic"), "some", "-o", str(folder / "a.h5"), "--no-picture", "-q"]) == 1
    return folder / "a.h5"


@pytest.mark.slow
def test_the_archive_has_the_words_where_a_case_is_done_and_doubtful(archive: Path) -> None:
    data = batch.open(str(archive)).load()
    assert data["status"].values.tolist() == [0, 0, 0, 0, 1]
    assert [bool(text) for text in data["warning"].values] == [False, True, False, True, False]
    assert np.abs(data["late"].values[[1, 3]]).min() > 1e6


def test_runs_and_show_say_it_once_for_all_such_cases(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(archive)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    said = "2 cases warning: t = 0.8 s: joint slide: it moves faster than 1e+06 m/s, which hardly anything could make"
    assert shown.count(said) == 1 and shown.count("(#1) #1, #3") == 1
    assert "try a faster rate for the dynamics, which have 100 Hz. (#1)" in shown
    assert main(["show", str(archive), "--format", "json"]) == 0
    [doubt] = json.loads(capsys.readouterr().out)["experiments"][0]["doubts"]
    assert doubt["status"] == "warning" and doubt["cases"] == [1, 3] and doubt["cause"].startswith("t = 0.8 s: ")


def test_of_a_case_alone_it_is_said_where_it_is_so(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(archive), "--case", "#3"]) == 0
    assert "warning: t = 0.8 s: joint slide: it moves faster than" in capsys.readouterr().out
    assert main(["show", str(archive), "--case", "#2"]) == 0
    assert "warning" not in capsys.readouterr().out


def test_reports_have_it_among_the_notes(archive: Path) -> None:
    [group] = ArchiveFile(archive).groups
    [note] = [each for each in verdict(Pool("some", [group]), {}, named=False).notes if "Warning" in each]
    assert note.startswith("Warning of #1, #3: t = 0.8 s: joint slide: it moves faster than 1e+06 m/s")


def test_the_log_of_a_case_has_it(archive: Path) -> None:
    [group] = ArchiveFile(archive).groups
    lines = {place: log_lines(ExportedCase(group, place, place, np.arange(81) / 100, ())) for place in (0, 1)}
    warned = {place: [line.text for line in found if line.level == "WARNING"] for place, found in lines.items()}
    assert not warned[0] and len(warned[1]) == 1 and "faster than 1e+06 m/s" in warned[1][0]
