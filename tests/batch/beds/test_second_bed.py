"""A bed model and a bed driver of another package, those of tests/plugin: both are known to every command of `met bed`
by their declarations alone; whole messages of declarations that lack something."""

from __future__ import annotations

import os
import shutil
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import batch
import ic
import met_conformance as conformance
from hw import drivers
from hw.bed import BedDriver
from hw.beds import PORTS
from hw.ports import Opening, Port, PortKind
from met import cli, models
from met.diagnostic import Problem
from met.parameter import Memory, Parameter
from met.substitution import BEDS, LAWS
from met.substitution.bed import PARAMETERS, SIMULATION_PARAMETERS, check

PACKAGE = Path(__file__).parents[2] / "plugin"

DECK = """\
#include <two_link.ic>
run wired like nominal {
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 1 s;
    record   = [q, qd, shoulder.bed.shaft_rate, shoulder.bed.load_current];
    remove settle;
    remove volts;
    metric peak = max { of = shoulder.qd; }
    substitute shoulder { bed = ideal_bed;  law = velocity_tracking; }
}
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The example package as an installer would leave it, for this process and those that it starts."""
    site = tmp_path / "site"
    shutil.copytree(PACKAGE / "met_example_models", site / "met_example_models")
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    table = [
        line
        for group, entries in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in entries.items()))
    ]
    info = site / "met_example_models-0.1.0.dist-info"
    info.mkdir()
    (info / "entry_points.txt").write_text("\n".join(table) + "\n", encoding="utf-8")
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: met-example-models\nVersion: 0.1.0\n", encoding="utf-8"
    )
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    models.available.cache_clear()
    yield
    models.available.cache_clear()


@pytest.mark.release
@pytest.mark.usefixtures("installed")
def test_a_second_bed_model_at_a_port_is_its_simulation_to_the_counts_of_the_wire(
    met_bed: Callable[..., tuple[int, str, str]],
) -> None:
    status, said, _ = met_bed("run", "deck.ic", "wired", "--port", "emulated", "--no-picture", "-o", "bench.h5")
    assert status == cli.YES and "the case reached its end" in said
    batch.run(ic.compile("deck.ic", select=["wired"]), output="sim.h5")
    sim = batch.open("sim.h5")
    assert 0.02 < float(sim["qd"].sel(joint="shoulder")[0, -1]) < 0.03, "the joint is on its way to the command"
    bench = batch.open("bench.h5")
    # a bed without converters is told and read in counts of 2^-20 V, A and rad/s: 1e-6 A turn the shaft by 1e-3 rad/s
    # in a tick of 1 ms, the joint by 7e-7 rad/s
    assert abs(sim["qd"].values - bench["qd"].values).max() < 1e-6
    assert bench["shoulder.bed.shaft_rate"].isnull().all(), "what is inside a bed at a port nobody knows"


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_a_port_that_reads_more_of_a_model_than_it_declares_is_refused_at_the_deck_s_line(
    met_bed: Callable[..., tuple[int, str, str]],
) -> None:
    status, _, complained = met_bed("run", "deck.ic", "wired", "--port", "firmware", "--no-picture")
    assert status == cli.BAD_INPUT
    assert complained.startswith(
        "error[E429]: bed model `ideal_bed` of joint `shoulder` has no parameter `tau_max`, "
        "which port `firmware` reads\n"
        " --> deck.ic:9:5\n"
    )
    assert " = help: `tau_max`, N*m: largest torque of the drive motor\n" in complained
    for command in ("probe", "identify"):
        assert met_bed(command, "deck.ic", "wired", "--port", "firmware")[0] == cli.BAD_INPUT


@pytest.mark.release
@pytest.mark.usefixtures("installed")
def test_a_second_driver_is_probed_without_a_deck_and_run_with_one(
    met_bed: Callable[..., tuple[int, str, str]],
) -> None:
    status, said, _ = met_bed("probe", "--port", "flywheel:6.38e-5")
    assert status == cli.YES
    assert said.startswith("bed `flywheel` at flywheel:6.38e-5\n")
    assert "  line      none: the bed is in this process\n" in said
    status, said, _ = met_bed("clear", "--port", "flywheel:6.38e-5")
    assert status == cli.YES and "nothing was latched" in said
    status, said, _ = met_bed("run", "deck.ic", "--port", "flywheel:6.38e-5", "--no-picture", "-o", "bench.h5")
    assert status == cli.YES and "the case reached its end" in said
    assert "bed `flywheel`" in said
    batch.run(ic.compile("deck.ic", select=["wired"]), output="sim.h5")
    final = [float(batch.open(name)["qd"].sel(joint="shoulder")[0, -1]) for name in ("bench.h5", "sim.h5")]
    # the same motor and shaft in steps of 1 ms instead of exactly, with counts of 0.2 rad/s of 40
    assert final[0] == pytest.approx(final[1], rel=0.01)
    status, _, complained = met_bed("jitter", "--port", "flywheel:6.38e-5")
    assert status == cli.BAD_INPUT and "error[E426]: bed `flywheel` has no time of its own" in complained


@pytest.mark.usefixtures("installed")
def test_help_and_messages_name_the_second_driver(met_bed: Callable[..., tuple[int, str, str]]) -> None:
    status, said, _ = met_bed("--help")
    assert status == cli.YES
    assert "  flywheel:INERTIA  A flywheel on both motors, in this process, in lock-step.\n" in said
    assert drivers.ports_in_words() == (
        "a serial line, `emulated`, `firmware`, `qemu`, `can:BENCH.toml`, `flywheel:INERTIA`, or a transcript"
    )
    status, _, complained = met_bed("probe", "--port", "flywheel:none")
    assert status == cli.BAD_INPUT
    assert "error[E400]: port `flywheel:none`: `none` is no inertia\n" in complained


class TestFlywheel(conformance.LockStep, conformance.Simulated):
    """The example driver does what every driver of a bed without a time of its own does."""

    @pytest.fixture
    def bed(self, installed: None) -> Iterator[BedDriver]:
        kind = drivers.kind_of("flywheel:6e-5")
        with kind.open(Opening(Port("flywheel:6e-5"))) as bed:
            yield bed


@pytest.mark.parametrize("name", ["flywheel", "flywheel://host:1", "/dev/ttyUSB0", "socket://host:1", "emulated:x"])
@pytest.mark.usefixtures("installed")
def test_a_port_that_is_not_of_a_scheme_is_a_line(name: str) -> None:
    assert drivers.kind_of(name) is PORTS[-1]


def test_a_case_goes_on_at_another_line_and_at_no_other_bed() -> None:
    assert drivers.same_bed("/dev/ttyUSB0", "socket://host:1")
    assert drivers.same_bed("firmware", "firmware")
    assert not drivers.same_bed("firmware", "qemu")
    assert not drivers.same_bed("firmware", "/dev/ttyUSB0")


def offered(monkeypatch: pytest.MonkeyPatch, module: Any, group: str, *objects: Any) -> None:
    """Other packages offer these, under the name `mine`."""
    points = [
        SimpleNamespace(name="mine", value="my_bed:THIS", package=f"my-bed-{n}", load=lambda each=each: each)
        for n, each in enumerate(objects)
    ]
    monkeypatch.setattr(module, "offered", lambda asked: points if asked == group else [])


def kind_of(**fields: Any) -> PortKind:
    return PortKind(doc="Mine.", open=lambda opening: None, **fields)  # type: ignore[arg-type, return-value]


@pytest.mark.parametrize(
    ("objects", "wrong"),
    [
        ((3,), "is a int, not a hw.ports.PortKind"),
        ((kind_of(scheme="other"),), "offers a port of scheme `other`"),
        ((kind_of(scheme="mine"), kind_of(scheme="mine")), "offers port `mine`, which exists already"),
    ],
)
def test_an_entry_point_that_offers_no_driver_is_said(
    objects: tuple[Any, ...], wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    offered(monkeypatch, drivers, "met.bed_ports", *objects)
    with pytest.raises(Problem) as caught:
        drivers.kind_of("mine")
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.code == "E215"
    assert diagnostic.message == (
        f"entry point `mine = my_bed:THIS` of my-bed-{len(objects) - 1} in group `met.bed_ports` {wrong}"
    )
    assert drivers.kind_of("/dev/ttyUSB0") is PORTS[-1], "nobody else's port is hurt by it"


@pytest.mark.parametrize("bed", BEDS, ids=lambda bed: bed.name)
def test_met_s_own_bed_models_declare_what_is_read_of_them(bed: Any) -> None:
    assert check(bed) is None


@pytest.mark.parametrize("needed", PARAMETERS, ids=lambda needed: needed.name)
def test_a_bed_model_that_lacks_a_parameter_is_refused_by_its_name(
    needed: Parameter, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacking = tuple(each for each in BEDS[0].parameters if each.name != needed.name)
    assert refused(replace(BEDS[0], name="mine", parameters=lacking), monkeypatch) == (
        f"declares no parameter `{needed.name}`, which every bed model has",
        (f"`{needed.name}`, {needed.unit}: {needed.doc}",),
    )


@pytest.mark.parametrize(
    ("lacking", "whose"),
    [("torque_noise", "with an observer"), ("drift", "with an observer"), ("band", "of full balance")],
)
def test_a_law_that_lacks_a_parameter_is_refused_by_its_name(
    lacking: str, whose: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = next(law for law in LAWS if law.name == "torque_balance_observer")
    left = tuple(each for each in law.parameters if each.name != lacking)
    message, _ = refused(replace(law, name="mine", parameters=left), monkeypatch, kind="law")
    assert message == f"declares no parameter `{lacking}`, which every law {whose} has"


def changed(name: str, **fields: Any) -> Any:
    parameters = tuple(replace(each, **fields) if each.name == name else each for each in BEDS[0].parameters)
    return replace(BEDS[0], name="mine", parameters=parameters)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (changed("f_cut", unit="rad/s"), "declares `f_cut` in rad/s, and every bed model has it in Hz"),
        (changed("kt_load", shape="list"), "declares `kt_load`, which is no number"),
        (changed("delay", at_most=4.0), "lets `delay` be other than a whole number from 0 to 3"),
        (changed("delay", whole=False), "lets `delay` be other than a whole number from 0 to 3"),
        (changed("faults", shape="number", default=0.0), "has presets, and no parameter `faults` that names one"),
        (
            replace(BEDS[0], name="mine", memory=(Memory(name="filtered", unit="rad/s", doc="a rate"),)),
            "declares no memory `shaft_rate`, which every bed model has",
        ),
    ],
)
def test_a_bed_model_whose_declaration_is_unsound_is_refused(
    model: Any, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert refused(model, monkeypatch)[0] == message


def refused(model: Any, monkeypatch: pytest.MonkeyPatch, kind: models.Kind = "bed") -> tuple[str, tuple[str, ...]]:
    """Message, after the entry point, and help of the refusal of a model that another package offers."""
    offered(monkeypatch, models, f"met.{kind}s", model)
    with pytest.raises(Problem) as caught:
        models.available.__wrapped__(kind)
    [diagnostic] = caught.value.diagnostics
    head = f"entry point `mine = my_bed:THIS` of my-bed-0 in group `met.{kind}s` "
    assert diagnostic.code == "E215" and diagnostic.message.startswith(head)
    return diagnostic.message.removeprefix(head), tuple(diagnostic.help)


@pytest.mark.parametrize("name", ["ideal_bed", "flywheel"])
def test_the_page_shows_the_file_as_it_is(name: str) -> None:
    page = (PACKAGE.parents[1] / "docs" / "bed.md").read_text(encoding="utf-8")
    assert (PACKAGE / "met_example_models" / f"{name}.py").read_text(encoding="utf-8") in page


@pytest.mark.parametrize("needed", (*PARAMETERS, *SIMULATION_PARAMETERS), ids=lambda needed: needed.name)
def test_the_page_has_every_parameter_that_is_read_of_a_bed_model(needed: Parameter) -> None:
    page = (PACKAGE.parents[1] / "docs" / "bed.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ")]
    rows = [row for row in rows if f"`{needed.name}`" in row[0]]
    assert any(needed.unit in row[1].split(", ") for row in rows)
