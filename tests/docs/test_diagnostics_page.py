"""docs/diagnostics.md is whole and true: an entry for every code, and each deck and command on it says what is shown.

Before a block, a hidden comment may say more:

    <!-- moves.csv -->                the block is this file and not `deck.ic`
    <!-- moves.csv (text) -->         the file itself, not shown, its text on the lines between
    <!-- given: an archive -->        what `GIVEN` makes beside the deck

Named blocks that stand before the entries are there for all of them. A block of text is what `met check deck.ic`
prints; a console shows its own commands, and what the last of them prints. The line that counts errors is left out on
the page. `python -m tests.docs.test_diagnostics_page` writes all that is shown anew: read the difference.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from met import cli, models
from met.diagnostic import Problem
from met.messages.render import render

ROOT = Path(__file__).parents[2]
FILE = ROOT / "docs" / "diagnostics.md"
PAGE = FILE.read_text(encoding="utf-8")

_PIECE = re.compile(
    r"<!-- (?P<name>[^\n]*?)(?:\n(?P<hidden>.*?)\n)? ?-->|^```(?P<kind>\w+)\n(?P<text>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)
_COUNT = re.compile(r"(?:\A|\n)(?:\d+ (?:error|warning)s?(?:, )?)+\n\Z")


@dataclass
class Shown:
    """One message of the page: what was asked, what was said and where it stands; files by name, names of `GIVEN`."""

    code: str
    commands: list[str]
    said: str
    span: tuple[int, int]
    files: dict[str, str]
    given: list[str]


def entries(page: str) -> dict[str, tuple[int, int]]:
    """Where each entry of the page stands, by its code."""
    heads = list(re.finditer(r"^##.*$", page, re.MULTILINE))
    ends = [head.start() for head in heads[1:]] + [len(page)]
    found = [(re.match(r"### ([A-Z]\d{3}): ", head[0]), head.end(), end) for head, end in zip(heads, ends, strict=True)]
    return {code[1]: (start, end) for code, start, end in found if code is not None}


def shared(page: str) -> dict[str, str]:
    """The named files that stand before the entries of their section."""
    inside = entries(page).values()
    found = re.finditer(r"<!-- (\w+\.ic) -->\n```c\n(.*?)```", page, re.DOTALL)
    return {each[1]: each[2] for each in found if not any(a <= each.start() < b for a, b in inside)}


def all_shown(page: str) -> Iterator[Shown]:
    """All that the page says is printed, with what was there before."""
    of_section = shared(page)
    for code, (start, end) in entries(page).items():
        files, given, name, spent = dict(of_section), list[str](), "", False
        for piece in _PIECE.finditer(page, start, end):
            comment, hidden, kind, text = piece.group("name", "hidden", "kind", "text")
            if spent:
                files, given, spent = dict(of_section), [], False
            if comment is not None and comment.startswith("given: "):
                given.append(comment.removeprefix("given: "))
            elif comment is not None and hidden is not None:
                files[comment.removesuffix(" (text)")] = hidden + "\n"
            elif comment is not None:
                name = comment
            elif kind in ("text", "console"):
                lines = text.splitlines(keepends=True)
                commands = [line[6:].strip() for line in lines if line.startswith("$ met ")]
                said = "".join(line for line in lines if not line.startswith("$ met "))
                yield Shown(code, commands or ["check deck.ic"], said, piece.span("text"), files, given)
                spent = True
            else:
                files[name or "deck.ic"] = text
                name = ""


# What cannot be shown as text on the page


def parts(folder: Path) -> None:
    (folder / "parts").mkdir()
    for name in ("left.ic", "right.ic"):
        (folder / "parts" / name).touch()


def latin_1(folder: Path) -> None:
    text = (folder / "deck.ic").read_text(encoding="utf-8")
    (folder / "deck.ic").write_text(text, encoding="latin-1")


def comments(folder: Path) -> None:
    line = "// nothing at all\n"
    (folder / "deck.ic").write_text(line * ((3 << 20) // len(line)), encoding="utf-8")


def roots(folder: Path) -> None:
    lets = [f"let a{n} = {'sqrt(' * 30}a{n - 1}{')' * 30};\n" for n in range(20, 0, -1)]
    (folder / "deck.ic").write_text("".join(lets) + "let a0 = 2;\n", encoding="utf-8")


def nested_elements(folder: Path) -> None:
    inner = "".join(f"<part{n}>" for n in range(45))
    (folder / "one.urdf").write_text(f'<robot name="one">\n{inner}\n</robot>\n', encoding="utf-8")


def half_an_archive(folder: Path) -> None:
    cli.main(["run", "swing.ic", "-q", "--no-picture"])
    data = (folder / "swing.h5").read_bytes()
    (folder / "half.h5").write_bytes(data[: len(data) // 2])


def newer_plan(folder: Path) -> None:
    plan(folder, '"version":1}', '"version":9}')


def other_plan(folder: Path) -> None:
    plan(folder, '"hinge.servo.kp"', '"hinge.servo.kpp"')


def plan(folder: Path, old: str, new: str) -> None:
    cli.main(["plan", "swing.ic", "-q", "-o", "plan.json"])
    text = (folder / "plan.json").read_text(encoding="utf-8")
    assert old in text
    (folder / "plan.json").write_text(text.replace(old, new), encoding="utf-8")


def damaged_campaign(folder: Path) -> None:
    (folder / "deck.h5.campaign" / "shards").mkdir(parents=True)
    (folder / "deck.h5.campaign" / "shards" / "0-000000000-000000001").touch()
    (folder / "deck.h5.campaign" / "campaign.json").write_text('{"schema": "met.camp', encoding="utf-8")


def begun(folder: Path) -> None:
    """Three of five cases are done, of another deck of the same name."""
    import ic
    from batch.campaigns import resuming, tasks
    from batch.campaigns.campaign import prepare, values_sections
    from batch.campaigns.folder import Folder

    text = (folder / "deck.ic").read_text(encoding="utf-8")
    (folder / "deck.ic").write_text(text.replace("0.025", "0.02"), encoding="utf-8")
    campaign = prepare(ic.compile("deck.ic", select=["gains"]), output="deck.gains.h5")
    (folder / "deck.ic").write_text(text, encoding="utf-8")
    made = Folder(folder / "deck.gains.h5.campaign")
    made.lock()
    [section] = values_sections(campaign)
    resuming.describe(made, campaign, [section], resuming.campaign_key([section]))
    tasks.carry_out(section, tasks.Task(0, 0, 3), made.shards)
    made.close()


GIVEN: Mapping[str, Callable[[Path], None]] = {
    "the folder parts with the decks left.ic and right.ic": parts,
    "deck.ic in Latin-1": latin_1,
    "deck.ic with 3 MiB of comments": comments,
    "deck.ic with 20 lets, each the root of the root ... of the one before": roots,
    "one.urdf with elements 46 deep": nested_elements,
    "an archive, and half of it in half.h5": half_an_archive,
    "deck.h5.campaign, with campaign.json cut short": damaged_campaign,
    "deck.gains.h5.campaign, begun when kp was 0.02 V*s/rad": begun,
    "plan.json of schema 9": newer_plan,
    "plan.json with the parameter hinge.servo.kpp": other_plan,
}


def offer(patch: pytest.MonkeyPatch, model: Path) -> None:
    """Lets `MODEL` of this file be what another package offers."""
    found: dict[str, Any] = {}

    def load() -> Any:
        if not found:
            source = compile(model.read_text(encoding="utf-8"), model.name, "exec")
            exec(source, found)  # what the page shows
        return found["MODEL"]

    kind = re.findall(r"^MODEL = (\w+)\(", model.read_text(encoding="utf-8"), re.MULTILINE)[0].lower()
    point = SimpleNamespace(name="mine", value="model:MODEL", package="my-models", load=load)
    patch.setattr(models, "offered", lambda group: [point] if group == f"met.{kind}s" else [])
    models.available.cache_clear()


@contextlib.contextmanager
def in_a_folder() -> Iterator[Path]:
    """An empty folder, and being in it; models of other packages are forgotten in the end."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        try:
            yield Path(name)
        finally:
            models.available.cache_clear()


def printed(one: Shown) -> tuple[str, int]:
    """What the last command prints, errors where there are any, and its exit status."""
    told, answered = io.StringIO(), io.StringIO()
    with in_a_folder() as folder, pytest.MonkeyPatch.context() as patch:
        patch.delenv("MET_DECK_PATH", raising=False)
        for name, text in one.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        for name in one.given:
            GIVEN[name](folder)
        if "model.py" in one.files:
            offer(patch, folder / "model.py")
        for command in one.commands[:-1]:
            assert cli.main(shlex.split(command)) == cli.YES
        with contextlib.redirect_stderr(told), contextlib.redirect_stdout(answered):
            status = cli.main(shlex.split(one.commands[-1]))
    return _COUNT.sub("", told.getvalue() or answered.getvalue()), status


ALL = list(all_shown(PAGE))


@pytest.mark.slow
@pytest.mark.parametrize("one", ALL, ids=lambda one: one.code)
def test_what_the_page_shows_is_what_is_said(one: Shown) -> None:
    said, status = printed(one)
    assert said == one.said
    assert one.code in said
    assert status == (cli.YES if said.startswith("warning") and "error[" not in said else cli.BAD_INPUT)


# What the page has


def in_the_source() -> set[str]:
    files = [file for room in ("met", "ic", "batch", "hw") for file in (ROOT / room).rglob("*.py")]
    return {code for file in files for code in re.findall(r'"([A-Z]\d{3})"', file.read_text(encoding="utf-8"))}


def rows() -> list[list[str]]:
    """The cells of the page's last table: codes that are tested elsewhere."""
    found = re.findall(r"^\| ([A-Z]\d{3}) \| (.*) \| `(.*)` \|$", PAGE, re.MULTILINE)
    return [list(row) for row in found]


def test_every_code_is_on_the_page_once() -> None:
    shown = re.findall(r"^### ([A-Z]\d{3}): ", PAGE, re.MULTILINE)
    named = [*shown, *(code for code, _, _ in rows())]
    assert sorted(named) == sorted(set(named))
    assert set(named) == in_the_source()


def test_every_entry_has_a_deck_or_a_command_with_its_message() -> None:
    assert set(entries(PAGE)) == {one.code for one in ALL}


def test_every_entry_stands_in_the_section_that_the_table_of_contents_says() -> None:
    contents = re.findall(r"^\| \[(.*?)\]\(#(.*?)\) \| (.*?) \|$", PAGE, re.MULTILINE)
    heads = [(head[1], head.start()) for head in re.finditer(r"^## (.*)$", PAGE, re.MULTILINE)]
    assert [title for title, _, _ in contents] == [title for title, _ in heads]
    ends = [start for _, start in heads[1:]] + [len(PAGE)]
    for (title, link, codes), (_, start), end in zip(contents, heads, ends, strict=True):
        assert link == re.sub(r"[^\w-]", "", title.lower().replace(" ", "-"))
        among = {f"{first[0]}{n:03}" for first, last in re.findall(r"(\w\d{3})(?:-(\w\d{3}))?", codes)
                 for n in range(int(first[1:]), int((last or first)[1:]) + 1)}  # fmt: skip
        assert {code for code, (at, _) in entries(PAGE).items() if start < at < end} <= among | {""}, title


def test_codes_are_in_order_in_each_section_and_in_the_tables_of_all_pages() -> None:
    for section in re.split(r"^## ", PAGE, flags=re.MULTILINE):
        heads = re.findall(r"^### ([A-Z]\d{3}): ", section, re.MULTILINE)
        assert heads == sorted(heads)
    for file in FILE.parent.glob("*.md"):
        for table in re.findall(r"(?:^\|.*\n)+", file.read_text(encoding="utf-8"), re.MULTILINE):
            firsts = re.findall(r"^\| ([A-Z]\d{3})\b", table, re.MULTILINE)
            assert firsts == sorted(firsts), file.name
    for row in re.findall(r"^\| \[.*\]\(#.*\) \| (.*) \|$", PAGE, re.MULTILINE):
        assert row.split(", ") == sorted(row.split(", "))


def test_every_other_page_that_is_named_is_there() -> None:
    named = set(re.findall(r"\]\((\w+\.md)\)", PAGE))
    assert named and all((FILE.parent / name).is_file() for name in named)


@pytest.mark.parametrize(("code", "said", "file"), rows(), ids=lambda cell: cell[:4])
def test_a_code_that_is_tested_elsewhere_is(code: str, said: str, file: str) -> None:
    assert f"{code}]" in (ROOT / file).read_text(encoding="utf-8") or f'"{code}"' in (ROOT / file).read_text("utf-8")


# Codes that nothing else tests


def whole(ask: Callable[[], object]) -> str:
    """What is said of it, without the count."""
    with pytest.raises(Problem) as caught:
        ask()
    return _COUNT.sub("", render(caught.value.diagnostics, caught.value.sources))


def test_a_word_that_is_no_unit_where_a_unit_is() -> None:
    from ic.grammar.syntax import Unit, Word
    from ic.meaning.expressions.quantity import measure_of
    from met.diagnostic import Place

    place = Place("deck.ic", 1, 9, 2)
    assert whole(lambda: measure_of(Unit(((Word("Nm", place), 1),), place, "Nm"))) == (
        "error[D074]: `Nm` is not a unit\n"
        " --> deck.ic:1:9\n"
        "  = help: did you mean `N*m`?\n"
    )  # fmt: skip


def test_python_asks_where_nothing_comes_from() -> None:
    from ic.driver.explain import explain

    with in_a_folder() as folder:
        (folder / "swing.ic").write_text(shared(PAGE)["swing.ic"], encoding="utf-8")
        assert whole(lambda: explain("swing.ic", "hinge.servo.kpp")) == (
            "error[D163]: nothing is called `hinge.servo.kpp` in `hold`\n"
            " = help: did you mean `hinge.servo.kp`?\n"
        )  # fmt: skip


@pytest.mark.slow
def test_the_beginning_of_an_id_that_several_cases_have(monkeypatch: pytest.MonkeyPatch) -> None:
    import batch
    from batch.archive.read import ArchiveFile
    from batch.campaigns import campaign
    from met.plan import keys
    from tests.batch import plans

    plans.answering(monkeypatch)
    made = plans.plan(plans.gains(40))
    ids = keys.case_ids(plans.gains(40))
    begins = next(each[0] for each in ids if sum(other[0] == each[0] for other in ids) == 2)
    first, second = (row for row, each in enumerate(ids) if each[0] == begins)
    with in_a_folder():
        assert whole(lambda: campaign.prepare(made, cases=[begins])) == (
            f"error[E312]: case `{begins}` may be any of 2: #{first} of `gains`, #{second} of `gains`\n"
            f" = help: give more of its id, or its position: `--case '#{first}'`\n"
        )
        batch.run(made, output="a.h5")
        with ArchiveFile("a.h5") as file:
            assert whole(lambda: file.groups[0].find_case(begins)) == (
                f"error[E322]: case `{begins}` may be any of 2: {ids[first]}, {ids[second]}\n"
                " = help: give more of its id\n"
            )


def test_a_command_of_another_package_that_cannot_be_loaded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def load() -> None:
        raise ImportError("No module named 'walk'")

    monkeypatch.setattr(cli, "offered", lambda _: [SimpleNamespace(name="walk", package="met-walk", load=load)])
    assert cli.main(["walk"]) == cli.BAD_INPUT
    assert capsys.readouterr().err == (
        "error[E336]: cannot load the command `walk` of the package `met-walk`: No module named 'walk'\n"
        " = help: mend or uninstall that package\n"
        "\n1 error\n"
    )


def test_a_run_that_wants_more_memory_than_there_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import click

    @click.command()
    def hoard() -> None:
        raise MemoryError

    monkeypatch.setattr(cli, "offered", lambda _: [SimpleNamespace(name="hoard", package="", load=lambda: hoard)])
    assert cli.main(["hoard"]) == cli.BAD_INPUT
    assert capsys.readouterr().err == (
        "error[E337]: there is not enough memory for this\n"
        " = help: run fewer cases at once, or record less\n"
        "\n1 error\n"
    )


def main() -> None:
    """Writes anew what the page shows."""
    made, at = [], 0
    for one in ALL:
        start, end = one.span
        asked = "".join(f"$ met {command}\n" for command in one.commands) if "$ met " in PAGE[start:end] else ""
        made += [PAGE[at:start], asked, printed(one)[0]]
        at = end
    FILE.write_text("".join([*made, PAGE[at:]]), encoding="utf-8")


if __name__ == "__main__":
    main()
