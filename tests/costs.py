"""What each test costs in processor time, and that no tier of tests costs more than `tests/costs.toml` allows.

A tier is a set of tests that are run together. Each test is of one tier by its marks (`tier_of`). The cost of a test
function is the processor time of its setups, calls and teardowns, of all its parameters together, with that of the
processes which it started and waited for. Processors differ, and a shared one is slower. So each process that runs
tests times a fixed piece of work now and then (`Slowness`), and costs are in seconds of the processor that the ledger
names.

A fixture that several tests share costs what its setups and teardowns do, in all processes that make it. Which test
comes first or last is chance, so the cost is the fixture's and not the test's.

A function or fixture that costs more than its limit times `FACTOR` is measured again, by its tests alone, and the
lesser cost counts: the first test of a process pays for what all of them import and compile. If that is still above, or
a tier costs more than its total times `TOTAL_FACTOR`, pytest's run fails.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

LEDGER = Path(__file__).with_name("costs.toml")
NEEDS = frozenset({"slow", "alone", "oracle", "compiler", "firmware", "cluster", "browser", "node"})
"""Marks of tests that are not for `scripts/test`: too dear for it, or with a need besides Python and git."""
FACTOR = 3.0
"""How many times its limit a function may cost: what is left of a machine's load after calibration is far less."""
TOTAL_FACTOR = 1.25
"""The same of a tier as a whole, in which single deviations even out."""
CALIBRATED_EVERY = 10.0
"""Seconds, of wall time, after which a process times the calibrating work again."""


@dataclass(frozen=True)
class Tier:
    """A tier's limits in the ledger: for each test function, each shared fixture, and all, in calibrated seconds."""

    function: float
    fixture: float
    total: float


@dataclass(frozen=True)
class Ledger:
    """What `tests/costs.toml` says.

    calibration  seconds that `work` takes on the processor whose seconds count
    tiers        limits of each tier that has some, by its name
    dear         test functions that may cost more than their tier's limit: how many seconds, and why
    """

    calibration: float
    tiers: Mapping[str, Tier]
    dear: Mapping[str, tuple[float, str]]

    def allowed(self, tier: str, name: str) -> float:
        """Seconds that this test function or fixture of a tier may cost; infinite in a tier without limits."""
        if tier not in self.tiers:
            return math.inf
        limits = self.tiers[tier]
        return self.dear[name][0] if name in self.dear else limits.fixture if "::fixture " in name else limits.function

    def is_exceeded(self, tier: str, name: str, seconds: float) -> bool:
        """Whether these seconds are too many for this test function or fixture."""
        return seconds > FACTOR * self.allowed(tier, name)


def read_ledger(path: Path = LEDGER) -> Ledger:
    """The ledger, read from its file."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    tiers = {
        name: Tier(float(limits["function"]), float(limits["fixture"]), float(limits["total"]))
        for name, limits in table["tier"].items()
    }
    dear = {name: (float(entry["seconds"]), str(entry["why"])) for name, entry in table.get("dear", {}).items()}
    return Ledger(float(table["calibration"]), tiers, dear)


def tier_of(marks: Iterable[str]) -> str:
    """The tier of a test with these marks: `release`, `ci` or `default`."""
    marked = set(marks)
    if "release" in marked:
        return "release"
    return "ci" if marked & NEEDS else "default"


def work() -> float:
    """Processor seconds of the calibrating work: what tests mostly do, which is Python over small objects."""
    began = time.process_time()
    found: dict[str, int] = {}
    for number in range(60_000):
        name = f"{number % 997}"
        found[name] = found.get(name, 0) + number * number % 7
    return time.process_time() - began


class Slowness:
    """How much slower than the ledger's processor this one is just now, from the last timings of the work."""

    def __init__(self, reference: float) -> None:
        self._reference = reference
        self._timed_at = float("-inf")
        self._value = 1.0

    def now(self) -> float:
        """The factor, timed again if the last time is long ago. The least of three is spoilt by interruptions least."""
        if time.monotonic() - self._timed_at > CALIBRATED_EVERY:
            self._value = min(work() for _ in range(3)) / self._reference
            self._timed_at = time.monotonic()
        return self._value


def _spent() -> float:
    """Processor seconds of this process and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


class Measured:
    """Plugin of each process that runs tests: puts costs into the reports of phases, in calibrated seconds.

    cost      of the phase, without that of shared fixtures
    fixtures  cost of each shared fixture that was set up or torn down in it, by `FILE::fixture NAME`
    """

    def __init__(self, ledger: Ledger) -> None:
        self._slowness = Slowness(ledger.calibration)
        self._counted = 0.0  # what was spent before this phase
        self._torn_down: float | None = None  # in a teardown: what was spent before that of the next fixture
        self._fixtures: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self) -> Generator[None, object, object]:
        self._slowness.now()  # not counted as the test's
        self._counted = _spent()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        spent, slowness = _spent() - self._counted, self._slowness.now()
        report.cost = (spent - sum(self._fixtures.values())) / slowness  # type: ignore[attr-defined]
        report.fixtures = {name: cost / slowness for name, cost in self._fixtures.items()}  # type: ignore[attr-defined]
        self._fixtures = {}
        self._counted, self._torn_down = _spent(), None
        return report

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_teardown(self) -> None:
        self._torn_down = _spent()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[object]) -> Generator[None, object, object]:
        others, before = sum(self._fixtures.values()), _spent()
        try:
            return (yield)
        finally:
            within = sum(self._fixtures.values()) - others  # fixtures that this one asked for on its way
            self._add(fixturedef, _spent() - before - within)

    def pytest_fixture_post_finalizer(self, fixturedef: pytest.FixtureDef[object]) -> None:
        if self._torn_down is not None:  # else it makes place for another parameter's, which is the test's doing
            spent = _spent()
            self._add(fixturedef, spent - self._torn_down)
            self._torn_down = spent

    def _add(self, fixturedef: pytest.FixtureDef[object], spent: float) -> None:
        if fixturedef.scope != "function":
            name = f"{fixturedef.baseid}::fixture {fixturedef.argname}"
            self._fixtures[name] = self._fixtures.get(name, 0.0) + spent


class Counted:
    """Plugin of the process that is told all reports: adds their costs up, and compares them with the ledger."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._costs: dict[tuple[str, str], float] = defaultdict(float)  # by tier and test function

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        tier, function = tier_of(report.keywords), report.nodeid.partition("[")[0]
        self._costs[tier, function] += getattr(report, "cost", 0.0)
        for name, cost in getattr(report, "fixtures", {}).items():
            self._costs[tier, name] += cost

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        measured_again = "MET_TEST_AGAIN" in os.environ  # by the run whose costs are compared
        if session.exitstatus == pytest.ExitCode.OK and not measured_again:
            self._measure_again(session.config)
            if excesses(self._costs, self._ledger):
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def _measure_again(self, config: pytest.Config) -> None:
        """Take the lesser cost of each function and fixture that costs too much, after its tests have run alone."""
        dear = [name for (tier, name), seconds in self._costs.items() if self._ledger.is_exceeded(tier, name, seconds)]
        if not dear:
            return
        tests = [name.partition("::fixture ")[0] for name in dear]
        with tempfile.NamedTemporaryFile() as file:
            environment = {name: value for name, value in os.environ.items() if name != "MET_TEST_REST"}
            environment |= {"MET_TEST_COSTS": file.name, "MET_TEST_AGAIN": "1"}
            words = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider"]
            words += ["-m", config.option.markexpr, *tests]
            done = subprocess.run(words, cwd=config.rootpath, env=environment, stdout=subprocess.DEVNULL, check=False)
            if done.returncode != 0:
                return
            for line in Path(file.name).read_text(encoding="utf-8").splitlines():
                seconds, tier, name = line.split("\t")
                if name in dear:
                    self._costs[tier, name] = min(float(seconds), self._costs[tier, name])

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if wanted := os.environ.get("MET_TEST_COSTS"):
            lines = (f"{seconds:.3f}\t{tier}\t{name}\n" for (tier, name), seconds in sorted(self._costs.items()))
            Path(wanted).write_text("".join(lines), encoding="utf-8")
        totals = totals_of(self._costs)
        for tier, seconds in sorted(totals.items()):
            limit = self._ledger.tiers.get(tier)
            of = f" of {limit.total:.0f}" if limit else ""
            terminalreporter.write_line(f"processor seconds of the tests, tier {tier}: {seconds:.0f}{of}")
        for line in excesses(self._costs, self._ledger):
            terminalreporter.write_line(line, red=True)


def totals_of(costs: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """Seconds of each tier."""
    totals: dict[str, float] = defaultdict(float)
    for (tier, _), seconds in costs.items():
        totals[tier] += seconds
    return totals


def excesses(costs: Mapping[tuple[str, str], float], ledger: Ledger) -> list[str]:
    """What costs more than the ledger allows, a message each.

    costs  calibrated seconds by tier and test function; of a part of the tests too, which just costs less
    """
    lines = []
    for (tier, function), seconds in sorted(costs.items()):
        if ledger.is_exceeded(tier, function, seconds):
            allowed = ledger.allowed(tier, function)
            remedy = "mark it `slow`" if tier == "default" else "mark it `release`"
            if "::fixture " in function:
                remedy = remedy.replace("mark it", "mark the tests that use it")
            lines.append(
                f"TOO DEAR {function}: {seconds:.1f} s of processor time in all, where tier {tier} "
                f"has {allowed:g} s (it fails above {FACTOR * allowed:g} s): make it cheaper, {remedy}, or give it a "
                f"line with the reason in tests/costs.toml"
            )
    for tier, seconds in sorted(totals_of(costs).items()):
        limits = ledger.tiers.get(tier)
        if limits is not None and seconds > TOTAL_FACTOR * limits.total:
            lines.append(
                f"TOO DEAR tier {tier}: {seconds:.0f} s of processor time where tests/costs.toml has "
                f"{limits.total:.0f} s (it fails above {TOTAL_FACTOR * limits.total:.0f} s): make tests cheaper, or "
                f"change the ledger and say why"
            )
    return lines
