"""What `met new` writes checks, runs and is laid out as it is; a model is installed by pip and found by its name."""

from __future__ import annotations

import importlib
import io
import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import batch
import ic
from ic.beginnings import files
from ic.beginnings.models import MODELS
from ic.formatting.formatter import formatted
from met import cli, models
from tests.met import test_every_model as every
from tests.met.declarations import both_ways, test_defaults, test_ranges, test_traced, test_units
from tests.met.small_models import JOINTS, SMALLEST, Small

ROOT = Path(__file__).parents[3]
USES = {
    "servo": Small({"gain": 20.0, "limit": 5.0, "rotor": 0.2}),
    "sensor": Small({"cutoff": 20.0, "bias": 0.01, "noise": 0.02}),
    "environment": Small({"link": "tip", "damping": 3.0}),
    "command": Small({"to": 0.5, "over": 0.1}),
    "guide": Small({"over": 0.1, "to": 0.3}),
    "metric": Small(),
    "integrator": Small(),
}
"""What the small deck that every model of MET's own must run from says of the model `begun` of each kind."""


OF_DECLARATIONS = (
    test_traced.test_a_models_functions_give_the_same_recorded_as_with_floats,
    test_ranges.test_a_number_at_its_bound_is_taken_as_it_is,
    test_ranges.test_a_number_just_outside_is_refused_where_the_deck_writes_it,
    test_ranges.test_so_it_is_in_a_case_of_a_sweep,
    test_ranges.test_so_it_is_in_a_plan_by_hand,
    test_defaults.test_what_a_deck_leaves_out_has_its_default,
    test_defaults.test_writing_the_defaults_changes_neither_plan_nor_bits,
    test_defaults.test_what_must_be_written_is_missed_by_its_name,
)
OF_UNITS = (
    test_units.test_a_number_in_another_unit_is_the_same_number_in_si,
    test_units.test_a_bare_number_is_refused_where_there_is_a_dimension,
    test_units.test_a_number_of_another_dimension_is_refused,
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def new(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = cli.main(["new", *words])
    return (status, *capsys.readouterr())


def test_a_deck_is_written_and_what_to_do_next_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert new(capsys, "deck", "my_arm") == (
        0,
        """\
wrote my_arm.ic

  met check my_arm.ic  says what is wrong with it, if anything is
  met run my_arm.ic    simulates it and shows what came of it
""",
        "",
    )
    text = Path("my_arm.ic").read_text()
    assert formatted("my_arm.ic", text) == text
    assert cli.main(["check", "my_arm.ic"]) == 0
    assert capsys.readouterr() == ("my_arm.ic: 1 run, 1 sweep, 7 cases: no errors\n", "")


@pytest.mark.release
def test_the_deck_runs_and_meets_its_requirement_in_every_case() -> None:
    cli.main(["new", "deck", "my_arm", "-q"])
    archive = batch.run(ic.compile("my_arm.ic", select="all"), histories="none")
    assert archive.ok
    with batch.open(archive.path) as data:
        assert (data["gains"]["met"].values == 1).all() and data["gains"]["effort"].values.std() > 1.0


@pytest.mark.slow
def test_every_line_of_the_decks_head_that_begins_with_met_is_a_command_that_works(
    capsys: pytest.CaptureFixture[str],
) -> None:
    cli.main(["new", "deck", "my_arm", "-q"])
    lines = Path("my_arm.ic").read_text().splitlines()
    commands = [line[5:].split("  ")[0].split() for line in lines if line.startswith("//   met ")]
    assert len(commands) == 6
    for _, *words in commands:
        assert cli.main([*words, *(["--no-picture"] if words[0] == "run" else [])]) == 0, words


def installed(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """The package in this folder as an installer would leave it: on the path, with its entry points beside."""
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = []
    for group, points in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(str(folder))
    importlib.invalidate_caches()
    sys.modules.pop("begun_for_met", None)
    models.available.cache_clear()


@pytest.fixture
def begin(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Path]]:
    """Begins a model of a kind and installs it."""

    def begin(kind: str) -> Path:
        assert cli.main(["new", kind, "begun", "-q"]) == 0
        installed(monkeypatch, folder / "begun")
        return folder / "begun"

    yield begin
    sys.modules.pop("begun_for_met", None)
    models.available.cache_clear()


@pytest.mark.release
@pytest.mark.parametrize("kind", MODELS)
def test_a_model_does_what_every_model_must(
    kind: models.Kind, begin: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(kind)
    monkeypatch.setitem(SMALLEST, (kind, "begun"), USES[kind])
    every.test_a_model_declares_what_its_numbers_are(kind, "begun")
    every.test_it_runs_from_a_small_deck_and_its_bits_depend_on_the_case_alone(kind, "begun", tmp_path)
    both_ways.use_sines_of_ones_own(monkeypatch)
    for test in OF_DECLARATIONS:
        test(kind, "begun", tmp_path)
    for joint in JOINTS:
        for test in OF_UNITS:
            test(kind, "begun", joint, tmp_path)


@pytest.mark.release
@pytest.mark.parametrize("kind", MODELS)
def test_its_deck_checks_without_a_word_and_runs_and_is_laid_out(kind: str, begin: Callable[[str], Path]) -> None:
    deck = begin(kind) / "begun.ic"
    text = deck.read_text()
    assert formatted("begun.ic", text) == text
    assert ic.check(deck).diagnostics == ()
    assert batch.run(ic.compile(deck), output="begun.h5").ok


@pytest.mark.slow
@pytest.mark.parametrize("kind", MODELS)
def test_its_file_passes_the_projects_own_linter(kind: str, folder: Path) -> None:
    cli.main(["new", kind, "begun", "-q"])
    command = [sys.executable, "-m", "ruff", "check", "--config", str(ROOT / "pyproject.toml"), "begun"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.release
def test_pip_installs_what_is_written_and_met_finds_it(folder: Path) -> None:
    for kind in MODELS:
        cli.main(["new", kind, f"my_{kind}", "-q"])
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--disable-pip-version-check",
        "--target",
        "site",
        *(f"./my_{kind}" for kind in MODELS),
    ]
    subprocess.run(command, check=True, capture_output=True, text=True)
    surroundings = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder / 'site'}"}
    listed = subprocess.run(
        [sys.executable, "-m", "met.cli", "doc", "--format", "json"],
        env=surroundings,
        capture_output=True,
        text=True,
        check=True,
    )
    found = {(model["kind"], model["name"]) for model in json.loads(listed.stdout)}
    assert {(kind, f"my_{kind}") for kind in MODELS} <= found


def test_what_is_there_is_not_written_over_without_force(capsys: pytest.CaptureFixture[str]) -> None:
    Path("my_arm.ic").write_text("mine")
    assert new(capsys, "deck", "my_arm") == (
        2,
        "",
        """\
error[E344]: `my_arm.ic` is there already
 = help: --force writes over it; -o writes to another place

1 error
""",
    )
    assert Path("my_arm.ic").read_text() == "mine"
    assert new(capsys, "deck", "my_arm", "--force", "-q") == (0, "", "")
    assert Path("my_arm.ic").read_text().startswith("// my_arm.ic")


def test_what_is_no_file_is_not_written_into_and_a_link_is_not_followed(capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo("pipe.ic")
    assert new(capsys, "deck", "my_arm", "-o", "pipe.ic", "--force") == (
        2,
        "",
        """\
error[E338]: cannot write `pipe.ic`: it is not a regular file
 = help: -o names another place

1 error
""",
    )
    Path("mine").write_text("mine")
    Path("my_arm.ic").symlink_to("mine")
    assert new(capsys, "deck", "my_arm", "--force", "-q") == (0, "", "")
    assert not Path("my_arm.ic").is_symlink() and Path("mine").read_text() == "mine"


@pytest.mark.parametrize(("words", "said"), [
    (("deck", "a", "-o", "there"), "error[E338]: cannot write `there`: it is a folder\n"
     " = help: name a file in it: `-o there/arm.ic`\n"),
    (("deck", "a", "-o", "no/"), "error[E305]: cannot write no/: there is no such folder\n"
     " = help: for a file: `-o no`\n = help: for a folder, make it first: `mkdir -p no`\n"),
    (("servo", "a", "-o", "mine"), "error[E338]: cannot write `mine/a_for_met.py`: `mine` is a file, not a folder\n"
     " = help: -o names another place\n"),
])  # fmt: skip
@pytest.mark.parametrize("force", [(), ("--force",)])
def test_a_place_where_nothing_can_be_written_is_refused_and_nothing_is_made(
    words: tuple[str, ...], said: str, force: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("there").mkdir()
    Path("mine").write_text("mine")
    assert new(capsys, *words, *force) == (2, "", f"{said}\n1 error\n")
    assert sorted(os.listdir()) == ["mine", "there"]


def test_of_a_model_nothing_is_written_where_one_file_is_there(capsys: pytest.CaptureFixture[str]) -> None:
    Path("spring").mkdir()
    Path("spring/pyproject.toml").write_text("mine")
    status, _, err = new(capsys, "servo", "spring")
    assert status == 2 and "`spring/pyproject.toml` is there already" in err
    assert os.listdir("spring") == ["pyproject.toml"]


def test_o_says_where_and_the_name_may_have_its_ending(capsys: pytest.CaptureFixture[str]) -> None:
    assert new(capsys, "deck", "my_arm.ic", "-o", "decks/first.ic", "-q") == (0, "", "")
    assert "arm my_arm {" in Path("decks/first.ic").read_text()
    status, out, _ = new(capsys, "metric", "total", "-o", "packages/one")
    assert sorted(os.listdir("packages/one")) == ["pyproject.toml", "total.ic", "total_for_met.py"]
    assert status == 0 and "-m pip install -e ./packages/one " in out and "met run packages/one/total.ic " in out


@pytest.mark.parametrize(("words", "said"), [
    (("deck", "3 bars"), ("an arm cannot be called `3 bars`", "`bars` would do")),
    (("deck", "3 links"), ("an arm cannot be called `3 links`", " = help: a name is letters")),
    (("deck", "links"), ("an arm cannot be called `links`: with that word paths of a run begin", "choose another")),
    (("metric", "m."), ("a model cannot be called `m.`", " = help: a name is letters")),
    (("deck", "m"), ("an arm cannot be called `m`: that is the unit metre", "choose another name")),
    (("servo", "ideal"), ("there is a servo model `ideal` already", "`met doc servo ideal` says")),
])  # fmt: skip
def test_a_name_that_nothing_may_have_is_refused(
    words: tuple[str, str], said: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = new(capsys, *words)
    assert (status, out) == (2, "") and err.startswith(f"error[E343]: {said[0]}\n") and said[1] in err
    assert os.listdir() == []


def test_what_cannot_be_written_leaves_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(io.BytesIO):
        def write(self, data: Any) -> int:
            raise OSError(28, os.strerror(28))

    def new_full(path: str) -> Full:
        Path(path).touch()
        return Full()

    monkeypatch.setattr(files, "new_file", new_full)
    assert new(capsys, "deck", "bars") == (
        2,
        "",
        """\
error[E338]: cannot write `bars.ic`: no space left on device
 = help: nothing was kept; -o names another place

1 error
""",
    )
    assert os.listdir() == []


def test_the_kinds_of_the_command_are_those_that_can_be_begun() -> None:
    from ic.cli_new import new

    assert tuple(new.params[0].type.choices) == ("deck", *MODELS)  # type: ignore[attr-defined]
    assert set(files.MODELS) | {"bed", "law"} == set(models.GROUPS)
