"""docs/campaign.ipynb runs from top to bottom, says what it is stored with, and is fit to be read by others.

Where its outputs have changed for good: the slow test leaves the notebook as it has run in its temporary folder, whose
name it tells; copy it to docs.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import ic
from tests.oracles.package import Package

nbformat = Package("nbformat")

pytestmark = pytest.mark.oracle

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOK = DOCS / "campaign.ipynb"
BYTES = 300_000

ROOTED = re.compile(r"(?<![\w.*/])/\w[\w.-]*/")
"""The beginning of an absolute path; a unit such as `N m/rad` is none."""

TERMINAL = re.compile("\x1b|\r(?!\n)")
"""What belongs on a terminal only: colours, a line that is written over. (`!` ends its lines as a terminal does.)"""

SECONDS = re.compile(r"\b\d+(\.\d+)? s of computing|\d{4}-\d\d-\d\dT")
"""What another run would say otherwise."""


@pytest.fixture(scope="module")
def stored() -> Any:
    return nbformat.read(NOTEBOOK, as_version=nbformat.NO_CONVERT)


def codes(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def texts(cell: Any) -> dict[str, str]:
    """What a cell printed and what its pictures and values are in words, by kind."""
    found: dict[str, str] = {}
    for output in cell.outputs:
        if output.output_type == "stream":  # in as many pieces as the kernel happened to send
            found[output.name] = found.get(output.name, "") + output.text
        else:
            found[output.output_type] = found.get(output.output_type, "") + output.data.get("text/plain", "") + "\n"
    return found


def said(notebook: Any) -> dict[str, dict[str, str]]:
    """All texts by cell, but for the key of the engine's code, which any change of the engine changes."""
    return {
        cell.id: {kind: re.sub(r"(code_key: +)[\w:]+", r"\1...", text) for kind, text in texts(cell).items()}
        for cell in codes(notebook)
    }


def pictures(notebook: Any) -> list[str]:
    """The cells that draw one."""
    return [cell.id for cell in codes(notebook) for output in cell.outputs if "image/png" in output.get("data", {})]


class TestAsItIsStored:
    def test_it_is_a_notebook_of_moderate_size(self, stored: Any) -> None:
        nbformat.validate(stored)
        assert NOTEBOOK.stat().st_size < BYTES

    def test_its_outputs_are_those_of_one_run_from_top_to_bottom(self, stored: Any) -> None:
        cells = codes(stored)
        assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
        assert [cell.id for cell in cells if not cell.outputs] == ["begin"]
        assert pictures(stored) == ["draw-map", "draw-steps"]

    def test_nothing_went_wrong_and_nothing_was_complained_of(self, stored: Any) -> None:
        kinds = {kind for cell in codes(stored) for kind in texts(cell)}
        assert kinds == {"stdout", "execute_result", "display_data"}
        assert not any("Traceback" in text for cell in codes(stored) for text in texts(cell).values())

    @pytest.mark.parametrize("strange", [ROOTED, TERMINAL, SECONDS], ids=["path", "terminal", "time"])
    def test_no_output_is_of_one_machine_or_one_moment(self, strange: re.Pattern[str], stored: Any) -> None:
        printed = [text for cell in codes(stored) for text in texts(cell).values()]
        assert [match[0] for text in printed for match in strange.finditer(text)] == []

    def test_its_metadata_name_a_kernel_that_everyone_has_and_no_times(self, stored: Any) -> None:
        assert stored.metadata == {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        }
        assert not any(cell.metadata for cell in stored.cells)

    def test_the_pages_it_points_to_are_there(self, stored: Any) -> None:
        pages = re.findall(r"\]\(([^)#]+)\)", "".join(cell.source for cell in stored.cells))
        assert pages and [page for page in pages if not (DOCS / page).is_file()] == []

    def test_its_deck_has_the_one_warning_that_it_speaks_of(self, stored: Any, tmp_path: Path) -> None:
        (deck,) = (cell.source for cell in codes(stored) if cell.source.startswith("%%writefile boom.ic\n"))
        (tmp_path / "boom.ic").write_text(deck.partition("\n")[2], encoding="utf-8")
        compiled = ic.check(tmp_path / "boom.ic")
        assert [each.code for each in compiled.diagnostics] == ["D317"] and compiled.plan is not None
        assert [experiment.cases.count for experiment in compiled.plan.experiments] == [1, 2000]


@pytest.fixture
def two_cores() -> Iterator[None]:
    """The notebook's cluster has a worker for each core it may use: two here, on any machine that has as many."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:2])
    yield
    os.sched_setaffinity(0, before)


@pytest.fixture
def nobodys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An environment in which no user's settings of Jupyter and IPython count, `met` is ours, and nothing is left."""
    for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "IPYTHONDIR"):
        (tmp_path / name).mkdir()
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    with tempfile.TemporaryDirectory(prefix="met-") as short:  # sockets lie in it, whose paths have 107 characters
        monkeypatch.setenv("JUPYTER_RUNTIME_DIR", short)
        monkeypatch.setenv("TMPDIR", short)
        yield


@pytest.mark.release
@pytest.mark.usefixtures("two_cores", "nobodys")
def test_it_runs_and_says_what_is_stored(stored: Any, tmp_path: Path) -> None:
    import matplotlib.font_manager  # noqa: F401 - the first import on a machine makes a cache of fonts, and says so
    from nbclient import NotebookClient
    from traitlets.config import Config

    notebook = nbformat.read(NOTEBOOK, as_version=nbformat.NO_CONVERT)
    for cell in codes(notebook):
        cell.outputs, cell.execution_count = [], None
    here = tmp_path / "docs"
    here.mkdir()
    sockets = {"transport": "ipc", "ip": f"{os.environ['JUPYTER_RUNTIME_DIR']}/kernel"}
    client = NotebookClient(
        notebook, timeout=300, record_timing=False, coalesce_streams=True, shutdown_kernel="immediate",
        resources={"metadata": {"path": str(here)}}, config=Config({"KernelManager": sockets}),
    )  # fmt: skip
    client.execute()  # raises where a cell does
    assert list(here.iterdir()) == []  # all that it writes is in a folder of its own
    notebook.metadata = stored.metadata  # which would say the version of Python
    nbformat.write(notebook, tmp_path / NOTEBOOK.name)
    assert said(notebook) == said(stored), f"as it has run: {tmp_path / NOTEBOOK.name}"
    assert pictures(notebook) == pictures(stored)
