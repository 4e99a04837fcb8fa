"""docs/bed.md: its commands do what it says, and print what it shows."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import batch
from met import cli
from tests.docs.test_pages import codes_in_use

PAGE = (Path(__file__).parents[2] / "docs" / "bed.md").read_text(encoding="utf-8")
SHOWN = [each for block in re.findall(r"^```\n(\$ met .*?)^```", PAGE, re.DOTALL | re.MULTILINE)
         for each in re.findall(r"^\$ met (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE)]  # fmt: skip
"""Commands, and what they print."""

CHANGES = (
    (r"firmware( +)[0-9a-f]{16}", r"firmware\1..."), (r"session \d+", "session ..."),
    (r"answered in .* ms, at most .* ms", "answered in ..."), (r"up to \S+ Hz", "up to ... Hz"),
    (r"(\d+ Hz) (yes|no)", r"\1 ..."), (r"[\d.]+ s of computing", "... of computing"), (r"\([\d.]+ KiB\)", "(...)"),
    (r"about [\d.]+ KiB", "about ..."),
)  # fmt: skip
"""What is another in each version, on each machine or at each time."""


def steady(text: str) -> str:
    for found, put in CHANGES:
        text = re.sub(found, put, text)
    return text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("bed")
    [(name, text)] = re.findall(r"<!-- (\S+\.ic) -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    (found / name).write_text(text, encoding="utf-8")
    return found


@pytest.mark.slow
def test_what_it_shows_is_what_is_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert len(SHOWN) == 6
    for command, shown in SHOWN:
        assert cli.main(shlex.split(command)) == cli.YES, command
        said = steady(capsys.readouterr().out)
        if shown.startswith("...\n"):
            assert said.endswith(shown.removeprefix("...\n")), command
        else:
            assert said == steady(shown), command
    assert batch.open("bench.h5").status.values.tolist() == [0]


@pytest.mark.slow
def test_its_other_steps_can_be_done(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    jitter, identify = re.findall(r"^    met (bed .*)$", PAGE, re.MULTILINE)[:2]
    assert cli.main(shlex.split(jitter)) in (cli.YES, cli.NO)  # NO: this machine is busy
    assert cli.main(shlex.split(identify)) == cli.YES
    assert (folder / "shoulder.identified.ic").is_file()


def test_it_has_every_code_of_motor_beds() -> None:
    rows = re.findall(r"^\| (E4.*?) \|", PAGE, re.MULTILINE)
    named = set[str]()
    for row in rows:
        codes = re.findall(r"E\d{3}", row)
        named.update(f"E{n}" for n in range(int(codes[0][1:]), int(codes[-1][1:]) + 1))
    assert {code for code in codes_in_use() if code.startswith(("E40", "E41", "E42"))} <= named
