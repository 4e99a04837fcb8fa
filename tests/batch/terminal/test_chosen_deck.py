"""`met best --write`: whole messages, and the deck that is written runs as the chosen design did."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import batch
from met.cli import main

DECK = """#include <two_link.ic>

servo slewing like gearbox { kp = 0.01 V*s/rad; }

run arm like nominal {
    servos   { shoulder = slewing; }
    rates    { dynamics = 100 Hz;  servos = 100 Hz;  record = 10 Hz; }
    record   = [];
    duration = 6 s;
    remove settle;
    metric settle = settling_time { of = shoulder.qd;  target = slow;  band = 2 %; }
    require settle < 2 s;
}

sweep grid of arm {
    vary slewing.kp = linspace(0.010, 0.034, 5) V*s/rad;
    vary slewing.ki = linspace(0.06, 0.26, 5) V/rad;
    vary links.lower.mass = [15, 30] kg;
}

sweep named of arm { vary integrator = [modified_euler, rk4]; }
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the deck, and an archive of each of its sweeps."""
    folder = tmp_path_factory.mktemp("swept")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("arm.ic").write_text(DECK, encoding="utf-8")
        for sweep in ("grid", "named"):
            main(["run", "arm.ic", sweep, "-q", "--histories", "none", "--no-picture"])
    return folder


@pytest.fixture
def archive(swept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    shutil.copytree(swept, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    return "arm.grid.h5"


def said(capsys: pytest.CaptureFixture[str], *command: str) -> tuple[int, str, str]:
    status = main(["best", *command])
    out, err = capsys.readouterr()
    return status, out, err


DIFF = (
    "",
    "--- arm.ic",
    "+++ arm.ic (chosen)",
    "@@ -1,6 +1,6 @@",
    " #include <two_link.ic>",
    " ",
    "-servo slewing like gearbox { kp = 0.01 V*s/rad; }",
    "+servo slewing like gearbox { kp = KP V*s/rad;  ki = KI V/rad; }    // chosen of 25 designs: grid, arm.grid.h5",
    " ",
    " run arm like nominal {",
    "     servos   { shoulder = slewing; }",
    "",
)


@pytest.mark.release
def test_the_change_is_shown_and_written_only_when_it_is_asked_for(
    archive: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, plain, _ = said(capsys, archive)
    assert status == 0
    status, shown, _ = said(capsys, archive, "--diff")
    chosen = json.loads(said(capsys, archive, "--format", "json")[1])["best"]["chosen"]
    kp, ki = (chosen[path].split(" ")[0] for path in ("slewing.kp", "slewing.ki"))
    assert shown == plain + "\n".join(DIFF).replace("KP", kp).replace("KI", ki) and status == 0
    assert Path("arm.ic").read_text(encoding="utf-8") == DECK
    status, told, _ = said(capsys, archive, "--write")
    assert told == shown + "arm.ic: written; it changes arm\n" and status == 0
    assert f"kp = {kp} V*s/rad;  ki = {ki} V/rad;" in Path("arm.ic").read_text(encoding="utf-8")


@pytest.mark.release
def test_the_deck_that_is_written_gives_the_numbers_of_the_chosen_design(
    archive: str, capsys: pytest.CaptureFixture[str]
) -> None:
    data = json.loads(said(capsys, archive, "--write", "--format", "json")[1])
    assert data["deck"]["file"] == "arm.ic" and data["deck"]["written"] is True
    assert [line[0] for line in data["deck"]["diff"][3:]].count("+") == 1
    main(["run", "arm.ic", "arm", "-q", "--no-picture", "--set", "links.lower.mass=30 kg", "-o", "new.h5"])
    new, swept = batch.open("new.h5").load(), batch.open(archive).load()
    chosen = {path: float(value.split(" ")[0]) for path, value in data["best"]["chosen"].items()}
    here = np.isclose(swept["slewing.kp"], chosen["slewing.kp"]) & np.isclose(swept["slewing.ki"], chosen["slewing.ki"])
    here &= swept["links.lower.mass"] == 30.0
    assert float(new["settle"].values[0]) == float(swept["settle"].values[here.values][0])


@pytest.mark.slow
def test_windows_line_ends_are_kept(archive: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("arm.ic").write_bytes(DECK.replace("\n", "\r\n").encode())
    assert said(capsys, archive, "--write")[0] == 0
    data = Path("arm.ic").read_bytes()
    assert b"// chosen of 25" in data and data.count(b"\r\n") == data.count(b"\n") == DECK.count("\n")


@pytest.mark.slow
def test_a_copy_is_a_new_file(archive: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = said(capsys, archive, "--write", "-o", "tuned.ic")
    assert status == 0 and out.endswith("\ntuned.ic: written; it changes arm\n")
    assert Path("arm.ic").read_text(encoding="utf-8") == DECK
    assert "// chosen of 25 designs" in Path("tuned.ic").read_text(encoding="utf-8")
    assert said(capsys, archive, "--write", "-o", "tuned.ic") == (
        2,
        "",
        "error[E398]: `tuned.ic` is there already\n = help: name a file that is not: it would be lost\n\n1 error\n",
    )


CHANGED = """\
error[E398]: `arm.ic` is not what it was when the archive was made
 = help: run the sweep again; or `-o FILE` writes a copy, of the text that the archive holds

1 error
"""
GONE = """\
error[E398]: there is no `arm.ic` here, of which the archive is
 = help: go to its folder; or `-o FILE` writes a copy, of the text that the archive holds

1 error
"""


@pytest.mark.slow
def test_a_deck_that_is_another_now_is_left_alone(archive: str, capsys: pytest.CaptureFixture[str]) -> None:
    other = DECK.replace("6 s", "7 s")
    Path("arm.ic").write_text(other, encoding="utf-8")
    assert said(capsys, archive, "--write") == (2, "", CHANGED)
    assert Path("arm.ic").read_text(encoding="utf-8") == other
    Path("arm.ic").unlink()
    assert said(capsys, archive, "--write") == (2, "", GONE)


@pytest.mark.release
def test_a_deck_of_met_is_not_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    main(["run", "two_link.ic", "gains", "-q", "--histories", "none", "--no-picture", "-o", "gains.h5"])
    capsys.readouterr()
    chosen = ["gains.h5", "--by", "settle", "--over", "links.upper.mass"]
    status, _, err = said(capsys, *chosen, "--write")
    assert (status, err) == (
        2,
        "error[E398]: <two_link.ic> comes with MET, and is not written to\n"
        " = help: `-o FILE` writes a copy, of the text that the archive holds\n\n1 error\n",
    )
    status, out, _ = said(capsys, *chosen, "--write", "-o", "mine.ic")
    assert status == 0 and out.endswith("\nmine.ic: written; it changes nominal, and hybrid with it\n")


def test_a_choice_among_words_is_left_to_its_author(archive: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = said(capsys, "arm.named.h5", "--by", "settle", "--write")
    assert (status, err) == (
        2,
        "error[E397]: `integrator` cannot be written into the deck: it is a choice among words, not a number\n"
        " = help: write it by hand: `integrator = modified_euler;`\n\n1 error\n",
    )


@pytest.mark.slow
def test_what_was_set_for_the_archive_must_be_in_the_deck_first(
    archive: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["run", "arm.ic", "grid", "-q", "--histories", "none", "--no-picture", "-o", "set.h5"]
    main([*command, "--set", "slewing.v_max=19 V"])
    capsys.readouterr()
    assert said(capsys, "set.h5", "--write") == (
        2,
        "",
        "error[E398]: the archive was made with `--set 'slewing.v_max=19 V'`, which is not in its deck\n"
        " = help: write that into the deck, and run the sweep again\n\n1 error\n",
    )


@pytest.mark.slow
def test_where_no_design_is_good_none_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    deck = DECK.replace("settle < 2 s", "settle < 0.1 s").replace("0.034, 5", "0.034, 2").replace("0.26, 5", "0.26, 2")
    Path("arm.ic").write_text(deck, encoding="utf-8")
    main(["run", "arm.ic", "grid", "-q", "--histories", "none", "--no-picture"])
    capsys.readouterr()
    status, out, _ = said(capsys, "arm.grid.h5", "--write")
    assert status == 1 and out.endswith("\n\nno design is advised, so nothing is written into the deck\n")
    assert Path("arm.ic").read_text(encoding="utf-8") == deck


@pytest.mark.release
def test_a_table_that_the_sweep_takes_values_from_is_part_of_its_deck(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    deck = DECK + 'sweep listed of arm { from "gains.csv"; }\n'
    Path("arm.ic").write_text(deck, encoding="utf-8")
    Path("gains.csv").write_text("slewing.kp [V*s/rad],slewing.ki [V/rad]\n0.02,0.1\n0.03,0.2\n", encoding="utf-8")
    main(["run", "arm.ic", "listed", "-q", "--histories", "none", "--no-picture"])
    capsys.readouterr()
    assert said(capsys, "arm.listed.h5", "--by", "settle", "--diff")[0] == 0
    Path("gains.csv").write_text("slewing.kp [V*s/rad],slewing.ki [V/rad]\n0.02,0.1\n0.03,0.3\n", encoding="utf-8")
    assert said(capsys, "arm.listed.h5", "--by", "settle", "--diff") == (
        2,
        "",
        "error[E398]: gains.csv is not what it was when the archive was made\n"
        " = help: run the sweep again\n\n1 error\n",
    )


def test_a_file_without_write_is_no_command(archive: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = said(capsys, archive, "-o", "x.ic")
    assert status == 2 and "-o is the file for --write" in err
