"""`met fmt --upgrade`: decks rewritten to edition 2, with the proof that they mean what they meant."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

import ic
from ic.driver.upgrade import placeless
from ic.text.files import LIBRARY
from met import cli, units
from met.plan.keys import case_ids, inputs, structure_key
from tests.oracles.random_deck import random_deck

RUN = """\
arm a { link bar { mass = 1 kg;  shape = rod(length = reach, along = x); }
        joint j revolute { parent = base;  child = bar;  axis = z; } }
run r { arm = a;  rates { dynamics = 1 kHz; }  duration = 1 s;  record = [q]; }
sweep s of r { vary links.bar.mass = [1, 2] kg; }
"""


LEFT = """\
error[E346]: `part.ic` stays in its edition: it does not compile by itself
 --> part.ic:1:55
  |
1 | arm a { link bar { mass = 1 kg;  shape = rod(length = reach * (1/2 rev), along = x); }
  |                                                       ^^^^^ D065, no value `reach`
  = help: what it means cannot be compared before and after
  = help: name a deck that includes it, too: `met fmt --upgrade DECK PART`; or write the line by hand

1 error
"""


NO_RUN = """\
error[E346]: `part.ic` stays in its edition: it has no run, and what it means depends on the deck that includes it
 = help: name a deck that includes it, too: `met fmt --upgrade DECK PART`; or write the line by hand

1 error
"""

BROKEN = """\
error[E346]: `a.ic` stays in its edition: it cannot be read
 --> a.ic:1:13
  |
1 | let x = 3 kg
  |             ^ D021, expected `;`
  = help: mend it first: `met check` shows all that is wrong

1 error
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fmt(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = cli.main(["fmt", *words])
    return (status, *capsys.readouterr())


def meaning(path: str) -> object:
    """Everything of the plan of a deck's runs and sweeps but places, and all their keys."""
    plan = ic.compile(path, select="all")
    keys = [(structure_key(each.structure, inputs(each)), case_ids(each)) for each in plan.experiments]
    return [(each.name, placeless(each.parameters), placeless(each.structure)) for each in plan.experiments], keys


@pytest.mark.slow
@pytest.mark.parametrize(("before", "after"), [
    ("let reach = 1 m;\n", "deck 2;\n\nlet reach = 1 m;\n"),
    ("// a: an arm\n\nlet reach = 1 m;\n", "// a: an arm\n\ndeck 2;\n\nlet reach = 1 m;\n"),
    ("// a: an arm\nlet reach = 1 m;  // its\n", "// a: an arm\n\ndeck 2;\n\nlet reach = 1 m;  // its\n"),
    ("// a: an arm\n\n// how far\nlet reach = 1 m;\n", "// a: an arm\n\ndeck 2;\n\n// how far\nlet reach = 1 m;\n"),
    ("/* a */ deck 1;  // old\nlet reach = 1 m;\n", "/* a */ deck 2;  // old\nlet reach = 1 m;\n"),
    ("#pragma once\nlet reach = 1 m;\n", "deck 2;\n\n#pragma once\nlet reach = 1 m;\n"),
    (
        "let rev = 2;\nlet f = 3 kg/rev;  /* per */\nlet v = [1, 2, 3] m*rev;\nlet reach = 1/2 m^-1 + pi/4 1/m;\n",
        "deck 2;\n\nlet rev = 2;\nlet f = (3 kg)/rev;  /* per */\nlet v = ([1, 2, 3] m)*rev;\n"
        "let reach = 1/(2 m^-1) + pi/(4 1/m);\n",
    ),
    ("let ft = 2;\nlet reach = 1/2 m^-1*ft;\n", "deck 2;\n\nlet ft = 2;\nlet reach = 1/(2 m^-1)*ft;\n"),
])  # fmt: skip
def test_a_deck_gets_its_line_and_brackets_and_keeps_its_comments_plans_and_keys(
    before: str, after: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("a.ic").write_text(before + RUN)
    assert fmt(capsys, "a.ic")[0] == 0
    kept = meaning("a.ic")
    assert fmt(capsys, "--upgrade", "a.ic") == (0, "a.ic: upgraded\n", "")
    made = Path("a.ic").read_text()
    assert "".join(made.split()).startswith("".join(after.split()))
    assert made.split("arm a")[0].count("\n") == after.count("\n")
    assert meaning("a.ic") == kept
    assert [each.code for each in ic.check("a.ic").diagnostics] == []
    assert fmt(capsys, "--upgrade", "a.ic") == (0, "", "")
    assert Path("a.ic").read_text() == made


def test_check_and_diff_write_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    text = "let reach = 1 m;\n" + RUN
    Path("a.ic").write_text(text)
    fmt(capsys, "a.ic")
    text = Path("a.ic").read_text()
    assert fmt(capsys, "--upgrade", "--check", "a.ic") == (1, "a.ic: would be upgraded\n", "")
    status, out, _ = fmt(capsys, "--upgrade", "--diff", "a.ic")
    assert status == 0
    assert "+deck 2;" in out
    assert Path("a.ic").read_text() == text


def test_a_part_is_proved_by_the_deck_that_includes_it(capsys: pytest.CaptureFixture[str]) -> None:
    Path("part.ic").write_text(RUN.replace("reach", "reach * (1/2 rev)"))
    Path("deck.ic").write_text('let reach = 1 rev * 1 m;\n#include "part.ic"\n')
    fmt(capsys, "deck.ic", "part.ic")
    status, out, told = fmt(capsys, "--upgrade", "part.ic")
    assert (status, out) == (2, "")
    assert told == LEFT
    kept = meaning("deck.ic")
    assert fmt(capsys, "--upgrade", "deck.ic", "part.ic") == (0, "deck.ic: upgraded\npart.ic: upgraded\n", "")
    assert "1 / (2 rev)" in Path("part.ic").read_text()
    assert meaning("deck.ic") == kept


SHARED = """\
let ft = 0.5 m;
#include "part.ic"
arm a { link bar { mass = 1 kg;  shape = rod(length = ft, along = x); }
        joint j revolute { parent = base;  child = bar;  axis = z; } }
servo s { model = passive;  friction = load; }
run r { arm = a;  servos { j = s; }  rates { dynamics = 1 kHz; }  duration = 1 s;  record = [q]; }
"""


def test_a_file_without_a_run_is_proved_by_the_deck_that_includes_it_and_never_by_itself(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("part.ic").write_text("#pragma once\nlet load = 20 N*ft;\n")
    Path("deck.ic").write_text(SHARED)
    fmt(capsys, "deck.ic")
    kept, text = meaning("deck.ic"), Path("part.ic").read_text()
    assert fmt(capsys, "--upgrade", "part.ic") == (2, "", NO_RUN)  # by itself it would have feet
    assert Path("part.ic").read_text() == text
    assert fmt(capsys, "--upgrade", "part.ic", "deck.ic") == (0, "part.ic: upgraded\ndeck.ic: upgraded\n", "")
    assert Path("part.ic").read_text() == "deck 2;\n\n#pragma once\nlet load = (20 N) * ft;\n"
    assert meaning("deck.ic") == kept


OTHERWISE = """\
error[E346]: `part.ic` stays in its edition: in `../deck.ic`, which includes it, `r` would not have the same plan
 = help: `met check ../deck.ic` may warn of what the editions read otherwise (D392)

1 error
"""


@pytest.mark.slow
def test_a_file_with_a_run_is_proved_within_decks_that_include_it_too(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    servo = "servo s { model = passive;  friction = 20 N*ft; }\n"
    part = servo + RUN.replace("reach", "1 m").replace("arm = a;", "arm = a;  servos { j = s; }")
    (folder / "parts").mkdir()
    Path("parts/part.ic").write_text(part)
    Path("parts/more.ic").write_text('#include "part.ic"\n')
    Path("deck.ic").write_text('let ft = 0.5 m;\n#include "parts/more.ic"\n')
    fmt(capsys, "deck.ic", "parts")
    kept = Path("parts/part.ic").read_text()
    monkeypatch.chdir("parts")
    assert fmt(capsys, "--upgrade", "part.ic") == (2, "", OTHERWISE)  # by itself it has feet
    assert Path("part.ic").read_text() == kept
    Path("../deck.ic").write_text('let foot = 0.5 m;\n#include "parts/more.ic"\n')
    assert fmt(capsys, "--upgrade", "part.ic") == (0, "part.ic: upgraded\n", "")


def test_a_file_that_cannot_be_read_is_to_be_mended_first(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_text("let x = 3 kg\n")
    assert fmt(capsys, "--upgrade", "a.ic") == (2, "", BROKEN)


def test_what_would_not_mean_the_same_is_left_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    counting = "let reach = __LINE__ * 1 m;\n" + RUN
    macro = "#define HALF 1/2 m^-1\nlet reach = HALF;\n" + RUN
    for text, why in ((counting, "`r` would not have the same plan"), (macro, "D393, a number is divided by")):
        Path("a.ic").write_text(text)
        fmt(capsys, "a.ic")
        text = Path("a.ic").read_text()
        status, out, told = fmt(capsys, "--upgrade", "a.ic")
        assert (status, out) == (2, "")
        assert told.startswith(f"error[E346]: `a.ic` stays in its edition: {why}")
        assert Path("a.ic").read_text() == text


def test_standard_input_and_plans_are_not_upgraded(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, told = fmt(capsys, "--upgrade", "-")
    assert status == 2
    assert "--upgrade takes files" in told
    Path("p.json").write_text("{}")
    assert fmt(capsys, "--upgrade", "p.json")[2].startswith("error[E342]")


@pytest.mark.release
@pytest.mark.parametrize("name", sorted(path.relative_to(LIBRARY).as_posix() for path in LIBRARY.rglob("*.ic")))
def test_standard_decks_can_be_upgraded(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (LIBRARY / name).read_text()
    old = text.replace("deck 2;\n\n", "", 1)
    assert old != text
    Path("a.ic").write_text(old)
    before = meaning("a.ic")
    assert fmt(capsys, "--upgrade", "a.ic") == (0, "a.ic: upgraded\n", "")
    assert Path("a.ic").read_text() == text
    assert meaning("a.ic") == before == meaning(str(LIBRARY / name))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_decks_with_values_that_are_called_as_units_are_keep_their_plans(
    seed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    pick = random.Random(seed)
    text = ""
    for n, name in enumerate(pick.sample(sorted(units.FURTHER_UNITS), 4)):
        number = round(pick.uniform(0.5, 3), 2)
        quantity = pick.choice(["3 kg", "(1 + 2) kg", "1/4 m", "2 kg*m/s^2", "4 1/s"])
        text += f"let {name} = {number};\nlet x_{n} = {quantity}{pick.choice('*/')}{name};\n"
    Path("a.ic").write_text(text + random_deck(seed))
    fmt(capsys, "a.ic")
    kept = meaning("a.ic")
    assert fmt(capsys, "--upgrade", "a.ic") == (0, "a.ic: upgraded\n", "")
    assert meaning("a.ic") == kept
    assert not [each for each in ic.check("a.ic").diagnostics if each.code in ("D392", "D393")]
