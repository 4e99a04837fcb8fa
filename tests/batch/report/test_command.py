"""`met report`: where the page goes, what is refused, in whole messages."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

import batch.report
from met import cli
from met.diagnostic import Problem
from met.messages.render import render
from tests.batch import plans
from tests.batch.report import archives

pytestmark = pytest.mark.usefixtures("engine")


@pytest.fixture
def sweep(here: Path) -> Path:
    return archives.made(here / "two_link.gains.h5", plans.gains(5))


def refused(*words: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert cli.main(["report", *words]) == cli.BAD_INPUT
    return capsys.readouterr().err.removesuffix("\n1 error\n")


@pytest.mark.slow
def test_the_page_lies_beside_the_archive(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", sweep.name]) == cli.YES
    size = Path("two_link.gains.html").stat().st_size
    assert capsys.readouterr().out == f"two_link.gains.html  ({size / 1024:.0f} KiB)\n"


@pytest.mark.slow
def test_quiet_says_nothing_and_another_name_and_title_are_taken(
    sweep: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["report", sweep.name, "-o", "r.html", "--title", "Gains & <loads>", "-q"]) == cli.YES
    assert capsys.readouterr().out == ""
    assert "<h1>Gains &amp; &lt;loads&gt;</h1>" in Path("r.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_one_run_of_several(here: Path) -> None:
    archives.made(here / "a.h5", plans.nominal(), plans.gains(3))
    assert cli.main(["report", "a.h5", "--run", "gains", "-q"]) == cli.YES
    text = Path("a.html").read_text(encoding="utf-8")
    assert "<title>two_link · gains</title>" in text and "met run a.h5 gains --case" in text


@pytest.mark.slow
def test_a_run_that_is_not_there(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(sweep.name, "--run", "gain", capsys=capsys) == (
        "error[E325]: no run or sweep `gain` in two_link.gains.h5\n = help: in it: gains\n"
    )
    assert not Path("two_link.gains.html").exists()


def test_no_archive(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused("a.h5", capsys=capsys) == (
        "error[E301]: cannot read the archive a.h5: no such file or directory\n"
        " = help: archives are written by `met run DECK`\n"
    )


@pytest.mark.slow
def test_a_folder(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("out").mkdir()
    assert refused(sweep.name, "-o", "out", capsys=capsys) == (
        "error[E380]: cannot write out: it is a folder\n = help: name a file in it: `-o out/report.html`\n"
    )


@pytest.mark.slow
def test_a_folder_that_is_not_there(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(sweep.name, "-o", "out/r.html", capsys=capsys) == (
        "error[E380]: cannot write out/r.html: out does not exist\n = help: make it first: `mkdir -p out`\n"
    )
    Path("out").touch()
    assert refused(sweep.name, "-o", "out/r.html", capsys=capsys) == (
        "error[E380]: cannot write out/r.html: out is a file, not a folder\n"
    )


@pytest.mark.slow
def test_somebody_elses_page_is_not_written_over(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("r.html").write_text("<h1>my notes</h1>", encoding="utf-8")
    assert refused(sweep.name, "-o", "r.html", capsys=capsys) == (
        "error[E380]: r.html exists and is no report of MET: it is not written over\n"
        " = help: give another name with `-o`, or remove the file\n"
    )
    assert Path("r.html").read_text(encoding="utf-8") == "<h1>my notes</h1>"


@pytest.mark.slow
def test_a_report_and_an_empty_file_are_written_over(sweep: Path) -> None:
    Path("r.html").touch()
    for _ in range(2):
        assert cli.main(["report", sweep.name, "-o", "r.html", "-q"]) == cli.YES


def test_a_pipe_is_no_place(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo("r.html")
    assert refused(sweep.name, "-o", "r.html", capsys=capsys) == (
        "error[E380]: cannot write r.html: it is not a regular file\n"
    )


def test_a_page_is_called_html(sweep: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(sweep.name, "-o", sweep.name, capsys=capsys) == (
        "error[E381]: cannot write two_link.gains.h5: reports are HTML files\n = help: `-o two_link.gains.html`\n"
    )
    assert refused(sweep.name, "-o", "r.pdf", capsys=capsys) == (
        "error[E381]: cannot write r.pdf: reports are HTML files\n"
        " = help: `-o r.html`\n"
        " = help: a browser prints the page to PDF: everything is open then, and light\n"
    )


@pytest.mark.slow
def test_a_full_disk_leaves_what_was_there(sweep: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch.report.report(sweep)
    before = Path("two_link.gains.html").read_bytes()

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "no space")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Problem) as caught:
        batch.report.report(sweep, title="another")
    assert render(caught.value.diagnostics) == (
        f"error[E380]: cannot write {sweep.with_suffix('.html')}: no space left on device\n"
        " = help: `-o FILE` names another place\n"
        "\n1 error\n"
    )
    assert Path("two_link.gains.html").read_bytes() == before
    assert not list(Path().glob(".*.tmp"))


@pytest.mark.slow
def test_a_killed_writer_leaves_no_page(sweep: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        batch.report.report(sweep)
    assert sorted(path.name for path in Path().iterdir()) == ["two_link.gains.h5", "two_link.gains.h5.run.json"]
