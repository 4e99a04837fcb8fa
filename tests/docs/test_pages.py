"""docs/architecture.md, models.md and physics.md say what the code says, and docs/README.md lists all pages."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray

import batch
import ic
from met import cli
from met.diagnostic import Problem
from met.messages import render
from met.servos.servo import JointMotion
from met.trace import Graph

ROOT = Path(__file__).parents[2]


def page(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def codes_in_use() -> set[str]:
    files = [file for room in ("met", "ic", "batch", "hw") for file in (ROOT / room).rglob("*.py")]
    return {code for file in files for code in re.findall(r'"([A-Z]\d{3})"', file.read_text(encoding="utf-8"))}


def test_every_code_of_a_diagnostic_is_in_one_range_of_the_page_and_no_range_is_empty() -> None:
    rows = re.findall(r"^\| ([A-Z])(\d{3})(?:-\1(\d{3}))? \|", page("architecture.md"), re.MULTILINE)
    ranges = [{f"{letter}{n:03}" for n in range(int(first), int(last or first) + 1)} for letter, first, last in rows]
    used = codes_in_use()
    assert len(used) > 100
    assert {code: sum(code in each for each in ranges) for code in used} == dict.fromkeys(used, 1)
    assert all(each & used for each in ranges)


def test_the_exit_codes_are_those_of_the_command() -> None:
    codes = {int(code) for code in re.findall(r"^\| (\d+) \| ", page("architecture.md"), re.MULTILINE)}
    assert codes >= {cli.YES, cli.NO, cli.BAD_INPUT, cli.DEFECT, cli.INTERRUPTED, cli.PIPE_CLOSED}


DECK = """
#include <two_link.ic>
run brief like nominal {
    duration = 0.4 s;  remove settle;  metric q = final { of = elbow.q; }
    record += [servo.command, reaction, links.upper.position, links.upper.orientation];
}
sweep two of brief { vary gearbox.kp = [0.01, 0.02] V*s/rad; }
"""


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """An archive of one sweep, and one of a run and a sweep."""
    folder = tmp_path_factory.mktemp("archives")
    (folder / "brief.ic").write_text(DECK, encoding="utf-8")
    one, both = folder / "one.h5", folder / "both.h5"
    batch.run(ic.compile(folder / "brief.ic", select=["two"]), output=one)
    batch.run(ic.compile(folder / "brief.ic", select=["brief", "two"]), output=both)
    return one, both


@pytest.mark.slow
def test_an_archive_holds_what_the_page_lists_and_nothing_else(archives: tuple[Path, Path]) -> None:
    text = page("architecture.md")
    tables = text[text.index("| dimension | is |") : text.index("Histories of all cases are kept")]
    named = set(re.findall(r"`([^`]+)`", tables))
    with xarray.open_dataset(archives[0]) as data:
        signals = {str(name) for name in data if "recorded_case" in data[name].dims}
        others = {str(name) for name in data.variables} - signals - {"volts"}  # a metric, named by the deck
        assert {name for name in others if not name.startswith("at_limit.")} - named == set()
        assert {"metrics.q", "gearbox.kp", "case", "recorded_case", "axis", "quaternion"} <= others
        assert signals == {
            "q", "qd", "tau", "shoulder.servo.voltage", "servo.command", "reaction.moment", "reaction.force",
            "links.upper.position", "links.upper.orientation",
        }  # fmt: skip
        rows = re.findall(r"^\| [a-z, ]*such as `(\S+)` \| (recorded_case, time.*?) \|", tables, re.MULTILINE)
        assert len(rows) == 5
        assert {name: data[name].dims for name, _ in rows} == {name: tuple(dims.split(", ")) for name, dims in rows}
        assert data["metrics.q"].dims == ("case",)
        assert data.qd.sel(recorded_case=1).sizes == {"time": 11, "joint": 2}
    with xarray.open_dataset(archives[0], group="provenance") as kept:
        assert {str(name) for name in (*kept.variables, *kept.attrs)} <= named
        assert DECK in kept["source_text"].values.tolist()


@pytest.mark.slow
def test_an_archive_of_several_opens_as_the_page_says(archives: tuple[Path, Path]) -> None:
    with xarray.open_dataset(archives[1]) as root:
        assert len(root.variables) == 0 and "deck" in root.attrs
    with xarray.open_datatree(archives[1]) as tree:
        assert set(tree.children) == {"brief", "two", "provenance"}
    with xarray.open_dataset(archives[1], group="two") as two:
        assert two.sizes["case"] == 2


def test_the_page_shows_the_plugins_whole_pyproject() -> None:
    shown = re.findall(r"```toml\n(.*?)```", page("models.md"), re.DOTALL)
    assert shown == [(ROOT / "tests" / "plugin" / "pyproject.toml").read_text(encoding="utf-8")]


def test_a_branch_in_a_model_prints_what_the_page_shows(tmp_path: Path) -> None:
    source = (ROOT / "tests" / "plugin" / "met_example_models" / "velocity_servo.py").read_text(encoding="utf-8")
    law = "    wanted = clip(p.gain * (held.qd_cmd - joint.qd), -p.limit, p.limit)\n"
    branch = "    wanted = p.gain * (held.qd_cmd - joint.qd)\n    if wanted > p.limit:\n        wanted = p.limit\n"
    assert law in source
    file = tmp_path / "velocity_servo.py"
    file.write_text(source.replace(law, branch), encoding="utf-8")
    spec = importlib.util.spec_from_file_location("velocity_servo_with_a_branch", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
        graph = Graph()
        p = SimpleNamespace(gain=graph.input("gain"), limit=graph.input("limit"), lag=0.01, rotor=2.0)
        joint = JointMotion(q=0.0, qd=0.3, time=0.0)
        with pytest.raises(Problem) as told:
            module.drive(p, SimpleNamespace(qd_cmd=0.4), SimpleNamespace(torque=5.0), joint)
    finally:
        del sys.modules[spec.name]
    said = render.render(told.value.diagnostics, told.value.sources).replace(f"{tmp_path}/", "")
    (shown,) = re.findall(r"```\n(error\[E200\].*?)```", page("models.md"), re.DOTALL)
    assert said.startswith(re.sub(r"--> \S*/", "--> ", shown))


@pytest.mark.slow
def test_the_stability_figure_has_one_name_in_messages_and_pages() -> None:
    checked = ic.check("two_link.ic")
    assert checked.diagnostics == ()
    ((warning, _),) = checked.allowed
    assert "h * lambda = 1.15" in warning.message
    for text in (page("physics.md"), page("models.md"), page("paper.md")):
        assert "h * lambda" in text
    assert "h * fastest" not in page("physics.md")
    assert all("1.15" in text for text in (page("physics.md"), page("paper.md")))


LINK = re.compile(r"\[[^\]]*\]\(([^)\s#:]*)(?:#([^)\s]+))?\)")
"""A link of a page to a file, to a heading of one, or to a heading of its own."""


def headings(file: Path) -> set[str]:
    """The names by which links lead to the headings of a page."""
    text = re.sub(r"^```.*?^```$", "", file.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_every_page_stands_in_the_list_of_questions() -> None:
    pages = {file.name for file in (ROOT / "docs").iterdir() if file.suffix in (".md", ".ipynb")}
    assert pages - {name for name, _ in LINK.findall(page("README.md"))} == {"README.md"}
    assert "(docs/README.md)" in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["README.md", "CHANGELOG.md", "docs/README.md"])
def test_every_link_of_a_list_of_pages_leads_to_a_page_and_a_heading(name: str) -> None:
    file = ROOT / name
    for target, heading in LINK.findall(file.read_text(encoding="utf-8")):
        linked = file.parent / target if target else file
        assert target.startswith("https:") or linked.exists(), target
        assert not heading or heading in headings(linked), f"{target}#{heading}"
