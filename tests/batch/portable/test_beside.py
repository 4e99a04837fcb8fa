"""`met view --against`: another archive's run, or a log of measured signals, beside the archive's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

from batch.portable.page import log_data
from met import cli
from met.diagnostic import Problem
from tests.batch.portable.test_arm_on_page import changed, opened, pixels
from tests.batch.report.browser import Chromium, browser_or_skip, quiet

DECK = """\
#include <two_link.ic>
run brief like nominal { duration = 1 s;  remove settle;  initial { elbow.q = 1 rad; } }
sweep tuned of brief { vary gearbox.kp = [0.005, 0.02] V*s/rad; }
sweep masses of brief { vary links.upper.mass = [45, 90] kg; }
"""

LOG = "# from the bench\ntime [s], shoulder.q [deg], elbow.q [deg], heat\n0, 0, 57.3, 20\n0.6, 30, 63.3, 21\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beside")
    (folder / "deck.ic").write_text(DECK, encoding="utf-8")
    for name, output, words in (
        ("tuned", "a", ()),
        ("tuned", "b", ("--set", "links.lower.mass=120 kg")),
        ("masses", "c", ()),
    ):
        run = ["run", str(folder / "deck.ic"), name, "-q", "--no-picture", "-o", str(folder / f"{output}.h5"), *words]
        assert cli.main(run) == cli.YES
    (folder / "log.csv").write_text(LOG, encoding="utf-8")
    return folder


chromium = pytest.fixture(scope="module")(browser_or_skip)


@pytest.mark.release
def test_a_log_is_in_si_on_straight_lines_between_its_rows_and_nothing_outside_of_them(folder: Path) -> None:
    columns = [{"channel": f"{joint}.q", "signal": "q", "unit": "rad"} for joint in ("elbow", "shoulder", "wrist")]
    found = log_data(folder / "log.csv", columns, np.array([0.0, 0.3, 0.6, 0.7]))
    elbow, shoulder, wrist = found["values"]
    assert wrist is None
    assert shoulder[:3] == pytest.approx(np.radians([0.0, 15.0, 30.0]), rel=1e-15)
    assert elbow[:3] == pytest.approx(np.radians([57.3, 60.3, 63.3]), rel=1e-15)
    assert np.isnan(shoulder[3]) and np.isnan(elbow[3])
    assert found["told"] == ["time [s]", "shoulder.q [deg]", "elbow.q [deg]"] and found["unused"] == ["heat"]


@pytest.mark.parametrize(
    ("last", "part"),
    [
        ("1", ""),
        ("20000", "the log is from 0 s to 20000 s, and the run from 0 s to 1 s: what both have is shown"),
        ("0.5", "the log is from 0 s to 0.5 s, and the run from 0 s to 1 s: what both have is shown"),
    ],
)
def test_a_log_of_another_span_than_the_run_is_told(tmp_path: Path, last: str, part: str) -> None:
    (tmp_path / "log.csv").write_text(f"time [s], elbow.q [deg]\n0, 1\n{last}, 2\n", encoding="utf-8")
    columns = [{"channel": "elbow.q", "signal": "q", "unit": "rad"}]
    assert log_data(tmp_path / "log.csv", columns, np.array([0.0, 0.5, 1.0]))["part"] == part


def test_the_times_of_a_log_that_is_elsewhere_are_told_apart(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("time [s], elbow.q [deg]\n1700000000, 1\n1700000020, 2\n", encoding="utf-8")
    columns = [{"channel": "elbow.q", "signal": "q", "unit": "rad"}]
    with pytest.raises(Problem) as caught:
        log_data(tmp_path / "log.csv", columns, np.array([0.0, 1.0]))
    assert "the log is from 1.7e+09 s to 1.70000002e+09 s" in caught.value.diagnostics[0].message


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "seconds [s], elbow.q [deg]\n0, 1\n1, 2\n",
            "error[E478]: `log.csv` has no column `time`\n --> log.csv:1:1\n",
        ),
        (
            "time [s], hand.q [deg]\n0, 1\n1, 2\n",
            "error[E478]: no column of `log.csv` is a signal that the run records\n --> log.csv:1:1\n",
        ),
        (
            "time [s], elbow.q [V]\n0, 1\n1, 2\n",
            "error[D193]: column `elbow.q` is in V, and rad is needed\n --> log.csv:1:11\n",
        ),
        ("time [s], elbow.q\n0, 1\n1, 2\n", "error[D193]: column `elbow.q` has no unit\n --> log.csv:1:11\n"),
        (
            "time [s], elbow.q [deg]\n100, 1\n101, 2\n",
            "error[E478]: the log is from 100 s to 101 s, and the run from 0 s to 1 s\n --> log.csv:1:1\n",
        ),
        ("time [s], elbow.q [deg]\n0, 1\n", "error[E478]: `log.csv` has fewer than two rows\n --> log.csv:1:1\n"),
        (
            "time [s], elbow.q [deg]\n0, 1\n0, 2\n",
            "error[D195]: times of a file rise, and 0 s follows 0 s\n --> log.csv:3:1\n",
        ),
    ],
)
def test_a_log_that_does_not_fit_is_refused_with_its_place(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    text: str,
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    assert cli.main(["view", str(folder / "a.h5"), "--against", "log.csv", "-o", "page.html"]) == 2
    assert capsys.readouterr().err.startswith(said)
    assert not (tmp_path / "page.html").exists()


@pytest.mark.slow
def test_what_is_neither_archive_nor_log_and_an_archive_of_no_same_case_are_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    for against, said in (
        (
            "deck.ic",
            "error[E478]: deck.ic is neither an archive nor a CSV or MCAP file\n"
            " = help: write it as a CSV file whose head names `time [s]` and channels with their units: "
            "`elbow.q [deg]`\n",
        ),
        ("none.csv", "error[D190]: cannot read the CSV file `none.csv`: No such file or directory\n"),
        ("c.h5", "error[E393]: no case of `tuned` is in both a.h5 and c.h5\n"),
    ):
        assert cli.main(["view", "a.h5", "--against", against, "-o", "page.html"]) == 2
        assert capsys.readouterr().err.startswith(said)
    assert cli.main(["view", "deck.ic", "--against", "a.h5"]) == 2
    assert "--against is for archives" in capsys.readouterr().err


@pytest.mark.browser
def test_another_archives_run_stands_beside_with_its_bits(chromium: Chromium, folder: Path, tmp_path: Path) -> None:
    words = ["view", str(folder / "a.h5"), "--against", str(folder / "b.h5"), "-q", "-o", str(tmp_path / "page.html")]
    assert cli.main(words) == 0
    page = opened(chromium, tmp_path / "page.html")
    compared = 0
    with xarray.open_dataset(folder / "b.h5") as data:
        for case in range(2):
            page.run(f"MET.page.put(MET_PAGE.description.cases.inputs[{case}].slice())")
            own = page.run("MET.page.plots()[0].data.slice(1, 3).map(each => Array.from(each))")
            scales = page.run("MET_PAGE.columnScales.slice(0, 2)")
            for values, scale, joint in zip(own, scales, ("shoulder", "elbow"), strict=True):
                expected = data["q"].values[case][:, data["joint"].values.tolist().index(joint)] / scale
                assert values == expected.tolist()
                compared += len(values)
            for row in page.run(
                "[...document.querySelectorAll('.answers tbody tr')].map(e => [...e.cells].map(c => c.innerText))"
            ):
                ours, theirs, change = (float(cell.split()[0].replace("−", "-")) for cell in row[1:4])
                assert theirs == pytest.approx(float(data[row[0].strip()][case]), rel=1e-3)
                assert change == pytest.approx(theirs - ours, abs=2e-3 * abs(theirs))
    assert compared > 100
    assert page.run("[...document.querySelectorAll('.answers th')].map(e => e.innerText.trim())")[1:4] == [
        "this",
        "b.h5",
        "b.h5 − this",
    ]
    assert "b.h5, the same numbers, computed here by the code" in page.run("document.querySelector('main').innerText")
    page.run("MET.shown.seek(1)")
    before = pixels(page, tmp_path)
    page.run("document.querySelector('.stage .view').focus()")
    page.key("b")
    assert changed(before, pixels(page, tmp_path)) > 0.0005
    quiet(page)
    page.close()


HOSTILE = "<img src=x onerror=document.title='hurt'>.csv"


@pytest.mark.browser
def test_a_log_stands_beside_while_it_lasts_and_its_names_are_texts(
    chromium: Chromium, folder: Path, tmp_path: Path
) -> None:
    text = LOG.replace("heat", "</script><img src=x onerror=document.title='hurt'>")
    (tmp_path / HOSTILE).write_text(text, encoding="utf-8")
    against, output = str(tmp_path / HOSTILE), str(tmp_path / "page.html")
    words = ["view", str(folder / "a.h5"), "--against", against, "-q", "-o", output]
    assert cli.main(words) == 0
    page = opened(chromium, tmp_path / "page.html", width=400)
    said = page.run("document.querySelector('main').innerText")
    assert "onerror" in said and "a log of time [s], shoulder.q [deg], elbow.q [deg]; not shown: </script>" in said
    assert page.run("document.querySelectorAll('img').length") == 0 and "hurt" not in page.run("document.title")
    assert page.run("document.documentElement.scrollWidth") <= 400
    page.run("MET.shown.seek(0.5)")
    shown = pixels(page, tmp_path)
    page.run("document.querySelector('.stage .tools .chip').click()")
    assert changed(shown, pixels(page, tmp_path)) > 0.0005
    page.run("MET.shown.seek(0.9)")  # the log has ended
    gone = pixels(page, tmp_path)
    page.run("document.querySelector('.stage .tools .chip').click()")
    assert changed(gone[80:], pixels(page, tmp_path)[80:]) < 0.0005
    lines = page.run("MET.page.plots()[0].data[1]")
    assert lines[0] == 0.0 and lines[-1] is None
    quiet(page)
    page.close()
