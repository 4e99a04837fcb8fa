"""What others wrote is printed so that it can be seen, and never as something that a terminal obeys."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from batch.archive.read import ArchiveFile
from batch.terminal import show
from batch.terminal.progress import Bar
from met.messages.visible import line, say, visible
from tests.batch.foreign.archives import changed, met, readers
from tests.batch.foreign.mutations import CONTROL

NASTY = "\x1b]0;owned\x07\x1b[2J\u202eevil\x9b31m\nsecond line"


def poisoned(file: Any) -> None:
    """Every text of an archive that is shown, with what a terminal would obey in it."""
    for run in ("open", "masses.rk4"):
        group = file[run]
        group["cause"][0], group["status"][0] = NASTY, 1
        group["case_id"][0] = NASTY
        for name in ("q", "qd", "end"):
            for attribute in ("units", "long_name", "deck_unit"):
                group[name].attrs[attribute] = NASTY
        group["requirement"][0] = f"end < {NASTY}"
        for attribute in ("arm", "integrator", "velocity_products", "structure_key", "code_key"):
            group.attrs[attribute] = NASTY
    file["masses.rk4/links.leaf.mass"].attrs["path"] = NASTY
    file["masses.rk4/integrator"][...] = NASTY
    file.attrs["deck"] = NASTY
    for name in ("version_met", "git_commit", "defines"):
        file["provenance"].attrs[name] = NASTY
    file["provenance/source"][0] = NASTY
    file["provenance/source_text"][0] = NASTY


@pytest.mark.release
def test_no_command_prints_what_a_terminal_obeys(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        poisoned(file)
    for name, words in readers(copy, tmp_path, archive).items():
        if name != "run --case":
            said = met(*words)
            assert said.status in (0, 1, 2), (name, said.text)
            assert not CONTROL.search(said.text), (name, CONTROL.search(said.text))
    shown = met("show", str(copy)).text
    assert r"\x1b]0;owned\x07\x1b[2J\u202eevil\x9b31m" in shown
    assert "\nsecond line" not in shown


def test_names_with_what_a_terminal_obeys_are_none_of_an_archives(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        file.move("open/qd", "open/q\x1b[2Jd")
    assert met("show", str(copy)).text == (
        f"error[E302]: the archive {copy} is damaged: a name in it has characters that no name has: q\ufffd[2Jd\n"
        " = help: an archive that MET writes has its name only when it is whole: was this one copied in part?\n"
        "\n1 error\n"
    )


@pytest.mark.slow
def test_what_is_printed_of_an_archive_has_nothing_that_a_terminal_obeys(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        poisoned(file)
    with ArchiveFile(copy) as opened:
        assert not CONTROL.search(show.show(opened))


def test_json_for_programs_has_neither_and_is_json(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        poisoned(file)
        file["open"].attrs["gain"] = float("nan")
    said = met("show", str(copy), "--format", "json").text

    def refuse(word: str) -> None:
        raise AssertionError(word)

    data = json.loads(said, parse_constant=refuse)
    assert data["deck"] == NASTY
    assert data["experiments"][0]["attributes"]["gain"] is None


def test_a_path_of_a_file_is_made_visible_in_messages(here: Path) -> None:
    name = "a\x1b[2J\u202e.h5"
    assert met("show", name).text.startswith("error[E301]: cannot read the archive a\ufffd[2J\ufffd.h5: no such file")
    assert not CONTROL.search(met("check", name).text)
    assert not CONTROL.search(met("status", name).text)
    assert not CONTROL.search(met("plan", name, "--all", "x").text)
    assert not CONTROL.search(met(name).text)


def test_what_a_campaigns_folder_says_of_itself_is_made_visible(
    here: Path, engine: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tests.batch.begun import begin, short_tasks

    short_tasks(monkeypatch)
    begin(Path("a.h5"))
    told = Path("a.h5.campaign/campaign.json")
    data = json.loads(told.read_text(encoding="utf-8"))
    data["sections"][0]["name"] = NASTY
    told.write_text(json.dumps(data), encoding="utf-8")
    status = Path("a.h5.campaign/status.json")
    data = {**json.loads(status.read_text(encoding="utf-8")), "host": NASTY, "workers": NASTY, "state": NASTY}
    status.write_text(json.dumps(data), encoding="utf-8")
    said = met("status", "a.h5")
    assert said.status == 1 and not CONTROL.search(said.text)
    assert "on " + line(NASTY) in said.text


def test_a_bar_shows_a_name_that_would_move_the_cursor() -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream, now = Terminal(), iter(range(100))
    bar = Bar(stream, lambda: float(next(now)))
    bar.begin(NASTY, 10, workers=NASTY)
    bar.advance(5)
    drawn = stream.getvalue().replace("\r", "").removesuffix("\x1b[K")
    assert not CONTROL.search(drawn) and line("\x1b]0;") in drawn


def test_what_is_said_exactly_is_so_where_no_terminal_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    say("\x1b[2J", end="", exact=True)
    assert capsys.readouterr().out == "\x1b[2J"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    say("\x1b[2J", end="", exact=True)
    assert capsys.readouterr().out == r"\x1b[2J"


def test_letters_of_all_languages_stay_as_they_are() -> None:
    assert visible("Größe — 長さ – ✗ e\u0301") == "Größe — 長さ – ✗ e\u0301"
    assert line("a\tb\nc\u2028d\ud800") == r"a\tb\nc\u2028d\ud800"


@pytest.mark.slow
def test_a_report_escapes_what_would_end_its_script(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        for run in ("open", "masses.rk4"):
            file[run]["cause"][0], file[run]["status"][0] = "</script><script>alert(1)</script><!--", 1
            file[run]["requirement"][0] = "end < 2 </script><img src=x onerror=alert(1)>"
            file[run]["q"].attrs["units"] = "</script>"
            file[run]["end"].attrs["long_name"] = "<script>alert(1)</script>"
        file.attrs["deck"] = "<script>alert(1)</script>"
        file["provenance/source_text"][0] = "</pre></script><script>alert(1)</script>"
    page = tmp_path / "report.html"
    assert met("report", str(copy), "-o", str(page), "--title", "<script>alert(1)</script>").status == 0
    text = page.read_text(encoding="utf-8")
    assert "alert(1)" in text
    assert (
        "<script>alert" not in text
        and "<img src=x" not in text
        and "</script><" not in text.replace("</script></body>", "").replace("</script>\n<", "")
    )


@pytest.mark.release
def test_pictures_and_pages_hold_what_was_made_visible(archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        poisoned(file)
    commands = readers(copy, tmp_path, archive)
    for name in ("plot", "report", "report --against", "export csv"):
        assert met(*commands[name]).status == 0, name
    ElementTree.parse(tmp_path / "plot.svg")
    for name in ("plot.svg", "report.html", "out.csv"):
        text = (tmp_path / name).read_text(encoding="utf-8").replace("\t", "")
        found = CONTROL.search(text)
        assert found is None, (name, text[max(0, found.start() - 80) : found.end() + 20])
