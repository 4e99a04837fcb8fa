"""What tests may cost is measured and held: `tests/costs.py`."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import costs
from tests.costs import Ledger, Tier

ROOT = Path(__file__).parents[1]
LEDGER = Ledger(
    0.01, {"default": Tier(0.5, 2.0, 10.0), "ci": Tier(5.0, 20.0, 100.0)}, {"tests/test_it.py::test_dear": (4.0, "why")}
)


@pytest.mark.parametrize(
    ("marks", "tier"),
    [((), "default"), (("parametrize",), "default"), (("slow",), "ci"), (("oracle",), "ci"), (("alone",), "ci"),
     (("slow", "release"), "release")],
)  # fmt: skip
def test_the_marks_of_a_test_say_its_tier(marks: tuple[str, ...], tier: str) -> None:
    assert costs.tier_of(marks) == tier


def test_a_function_that_costs_too_much_is_named_with_its_remedies() -> None:
    assert costs.excesses({("default", "tests/test_it.py::test_two"): 2.0}, LEDGER) == [
        "TOO DEAR tests/test_it.py::test_two: 2.0 s of processor time in all, where tier default has 0.5 s (it fails "
        "above 1.5 s): make it cheaper, mark it `slow`, or give it a line with the reason in tests/costs.toml"
    ]
    assert costs.excesses({("default", "tests/test_it.py::test_two"): 1.4}, LEDGER) == []
    assert "mark it `release`" in costs.excesses({("ci", "tests/test_it.py::test_two"): 16.0}, LEDGER)[0]


def test_a_shared_fixture_has_a_limit_of_its_own() -> None:
    name = "tests/test_it.py::fixture archive"
    assert costs.excesses({("default", name): 5.9}, LEDGER) == []
    assert "mark the tests that use it `slow`" in costs.excesses({("default", name): 6.1}, LEDGER)[0]


def test_a_function_of_the_ledger_may_cost_what_its_line_says() -> None:
    assert costs.excesses({("default", "tests/test_it.py::test_dear"): 9.0}, LEDGER) == []
    assert len(costs.excesses({("default", "tests/test_it.py::test_dear"): 12.5}, LEDGER)) == 1


def test_a_tier_that_costs_too_much_in_all_is_named() -> None:
    many = {("default", f"tests/test_it.py::test_{number}"): 0.5 for number in range(26)}
    assert costs.excesses(many, LEDGER) == [
        "TOO DEAR tier default: 13 s of processor time where tests/costs.toml has 10 s (it fails above 12 s): make "
        "tests cheaper, or change the ledger and say why"
    ]
    assert costs.excesses(dict.fromkeys(many, 0.4), LEDGER) == []


def test_tests_for_a_release_have_no_limit() -> None:
    assert costs.excesses({("release", "tests/test_it.py::test_hours"): 7200.0}, LEDGER) == []


def test_each_function_and_fixture_of_the_ledger_exists_and_has_a_reason() -> None:
    for name, (seconds, why) in costs.read_ledger().dear.items():
        where, _, function = name.partition("::")
        file = ROOT / where if where.endswith(".py") else ROOT / where / "conftest.py"
        tree = ast.parse(file.read_text(encoding="utf-8"))
        functions = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert function.removeprefix("fixture ") in functions, name
        assert seconds > 0 and why, name


WASTEFUL = """\
import subprocess
import sys
import time
from pathlib import Path

import pytest


@pytest.mark.parametrize("half", [1, 2])
def test_wasteful(half):
    begun = time.process_time()
    while time.process_time() - begun < 0.15:
        pass


def test_wasteful_in_a_child():
    work = "import time\\nwhile time.process_time() < 0.3: pass"
    subprocess.run([sys.executable, "-c", work], check=True)


@pytest.fixture(scope="module")
def dear():
    begun = time.process_time()
    while time.process_time() - begun < 0.15:
        pass
    yield
    begun = time.process_time()
    while time.process_time() - begun < 0.15:
        pass


def test_patient(dear):
    time.sleep(0.3)


def test_that_pays_once_for_all():
    begun = time.process_time()
    while not Path("paid").exists() and time.process_time() - begun < 0.3:
        pass
    Path("paid").touch()
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_a_run_with_such_a_function_fails_with_the_message(tmp_path: Path, processes: str) -> None:
    """Parameters are added up whatever process runs them, what a test starts counts, and waiting does not.

    What several tests share is not the first one's. What a function spends the first time alone is not held against it.
    """
    (tmp_path / "tests").mkdir()
    for name in ("conftest.py", "costs.py"):
        (tmp_path / "tests" / name).write_bytes((ROOT / "tests" / name).read_bytes())
    (tmp_path / "setup.cfg").write_bytes((ROOT / "setup.cfg").read_bytes())
    (tmp_path / "tests" / "instruction_sets.py").write_text('def header() -> str:\n    return ""\n')
    (tmp_path / "tests" / "test_it.py").write_text(WASTEFUL)
    # Each of the two spends 0.3 s, and fails above 0.06 s of a processor like this one.
    (tmp_path / "tests" / "costs.toml").write_text(
        f"calibration = {costs.work():.6f}\n[tier.default]\nfunction = 0.02\nfixture = 0.02\ntotal = 100\n"
    )
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "MET_TEST"))}
    words = [sys.executable, "-m", "pytest", "-n", processes]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, env=environment)
    said = [line.split(": ")[0] for line in done.stdout.splitlines() if line.startswith("TOO DEAR")]
    dear = ("fixture dear", "test_wasteful", "test_wasteful_in_a_child")
    assert said == [f"TOO DEAR tests/test_it.py::{name}" for name in dear], done.stdout
    assert "5 passed" in done.stdout and done.returncode == 1
