"""Every cell of the engine's own is of one declared family, so that no name is made up where it is used."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import ic
from met.plan import Experiment
from met.program import System, build, cells
from met.program.build import METRIC
from met.program.cells import GUIDE_FRAME, GUIDE_TIME, SHAFT_RATE, CellFamily
from met.program.motion.bodies import bodies
from met.program.observe import INSTANT, ROW
from met.program.step import FROM, STAGE
from met.program.system import PARAMETER, TREE
from met.trace.recorder import record
from tests.ic.small_decks import experiment
from tests.met.program.free_flyers import ARM
from tests.met.program.payload_decks import RUN
from tests.substitution.hybrid import compiled, deck, loads

FAMILIES = tuple(each for each in vars(cells).values() if isinstance(each, CellFamily))


def matches(family: CellFamily, name: str) -> bool:
    """True for the name of a cell of the family."""
    return re.fullmatch(re.escape(family.pattern).replace(r"\{\}", ".+"), name) is not None


def family_of(name: str) -> CellFamily | None:
    """The family of a cell: among those whose pattern matches its name, the most specific."""
    found = [family for family in FAMILIES if matches(family, name)]
    return max(found, key=lambda family: len(family.pattern.replace("{}", "")), default=None)


def test_a_family_names_its_cells_and_knows_them() -> None:
    assert SHAFT_RATE("elbow") == "elbow:w"
    assert matches(SHAFT_RATE, "elbow:w")
    assert not matches(SHAFT_RATE, "elbow:w_ref")
    assert family_of(GUIDE_TIME("tip")) is GUIDE_TIME
    assert family_of(GUIDE_FRAME("tip", "R01")) is GUIDE_FRAME
    assert family_of("elbow:speed") is None


def assert_declared(made: Experiment) -> set[str]:
    """The patterns of the families that this experiment's program has cells of; each cell is of one."""
    coordinates = tuple(f"{name}." for body in bodies(System(made)) for name in body.coordinates)
    others = (PARAMETER, TREE, METRIC, INSTANT, ROW, *coordinates)
    used = set()
    for cell in record(build(made)).cells:
        name = cell.removeprefix(FROM).removeprefix(STAGE)
        if ":" not in name or name.startswith(others):
            continue
        family = family_of(name)
        assert family is not None, cell
        used.add(family.pattern)
    return used


@pytest.mark.release
@pytest.mark.parametrize(
    ("name", "some"),
    [
        ("free_flyer.ic", {"need:{}", "{}:orientation.{}"}),
        ("station_arm.ic", {"guide:{}.rate", "guide:{}.{}"}),
        ("manutec_r3_one_axis.ic", {"friction:{}", "need:{}", "slope:{}"}),
    ],
)
def test_cells_of_a_deck_are_declared(name: str, some: set[str]) -> None:
    used = set().union(*(assert_declared(made) for made in ic.compile(name, select="all").experiments))
    assert some <= used


def test_cells_of_payloads_are_declared(tmp_path: Path) -> None:
    used = assert_declared(experiment(tmp_path, ARM, RUN))
    assert {family.pattern for family in FAMILIES if family.pattern.startswith("payload:")} <= used


@pytest.mark.slow
def test_cells_of_motors_on_beds_are_declared() -> None:
    used = assert_declared(
        compiled(deck(("shoulder", "elbow"), law="torque_balance_observer", sweep=loads([1.5, 2.0])), "bench")
    )
    assert {"{}:w", "{}:observer.{}", "{}:P.{}.{}", "{}:gain.{}"} <= used, used
