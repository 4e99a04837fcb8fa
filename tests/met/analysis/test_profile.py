"""What a profile counts, on real decks. No time is asserted."""

from __future__ import annotations

import numpy as np
import pytest

import ic
from met.analysis.profile import FLOPS, RunProfile, as_data, by_part, hoisted, profile
from met.backends.llvm import kernel
from met.backends.llvm.pieces import operations
from met.plan import Experiment
from met.program.build import build
from met.trace.recorder import record


def experiment(deck: str, name: str) -> Experiment:
    return ic.compile(deck, select=[name]).experiments[0]


@pytest.fixture(scope="module")
def gains() -> RunProfile:
    return profile(experiment("two_link.ic", "gains"))


@pytest.mark.slow
@pytest.mark.parametrize(("deck", "name"), [("two_link.ic", "gains"), ("panda.ic", "payload")])
def test_the_operations_of_a_sections_parts_are_all_that_the_section_computes(deck: str, name: str) -> None:
    for section in record(build(experiment(deck, name))).sections:
        found = by_part(section)
        live = operations(section)
        assert sum(count for count, _ in found.values()) == len(live)
        assert sum(flops for _, flops in found.values()) == sum(FLOPS.get(section.nodes[i][0], 0) for i in live)
        assert "" not in found  # nothing is outside of a phase


def test_a_stage_tells_servos_environment_and_dynamics_apart() -> None:
    """Gravity is a constant that the recursion takes, so of the environment nothing is left to compute."""
    sections = {section.name: section for section in record(build(experiment("panda.ic", "reach"))).sections}
    found = by_part(sections["derive"])
    assert set(found) == {"derive", "derive/servo physics", "derive/dynamics"}
    assert found["derive/dynamics"][0] > 10 * found["derive/servo physics"][0]


def test_a_varied_gain_is_read_where_it_is_used_and_a_varied_mass_is_worked_into_the_tree_before_the_run() -> None:
    asked = experiment("two_link.ic", "gains")
    found = {each.path: each for each in hoisted(asked, record(build(asked)))}
    assert list(found) == ["gearbox.kp", "gearbox.ki", "links.upper.mass", "links.lower.mass"]
    kp, mass = found["gearbox.kp"], found["links.lower.mass"]
    assert (kp.sets, kp.hoisted, kp.kept, kp.read_by) == (2, 0, 2, 2)  # one in each servo
    assert mass.sets == 1 and mass.hoisted > 0 and mass.read_by > mass.kept > 0


@pytest.mark.slow
def test_a_step_is_counted_as_the_rates_have_it(gains: RunProfile) -> None:
    """Servos at 100 Hz, dynamics and record at 25 Hz; the run's last instant has no step after it, 500 have."""
    calls = {(part.work, part.part): part.calls for part in gains.parts if not part.event}
    assert (gains.steps, gains.cases, gains.joints) == (500, 36, 2)
    assert calls["servo computers", ""] == 2001 / 500
    assert calls["first stage", "dynamics"] == calls["recorder", ""] == 501 / 500
    assert calls["integrator", ""] == calls["further stages", "dynamics"] == 500 / 500


@pytest.mark.slow
def test_friction_is_counted_apart_and_as_often_as_it_comes(gains: RunProfile) -> None:
    """At t = 0 both joints are at rest in every case, so each block decides; later they turn on and on."""
    events = {part.work: part for part in gains.parts if part.event}
    assert 1 / 500 <= events["friction decisions"].calls < 0.1
    assert all(part.calls < 0.1 for part in events.values())


def test_the_numbers_are_a_profiles(gains: RunProfile) -> None:
    assert gains.lanes % gains.vector == 0 and gains.blocks * gains.steps == 5000  # as many blocks as a short run needs
    assert gains.code_bytes > 1000 and gains.pieces >= 10
    assert 0.0 < gains.share_of_peak < 1.0
    assert all(part.ns > 0.0 for part in gains.parts if part.calls > 0.0)
    steady = sum(part.flops for part in gains.parts if not part.event)
    assert 0.0 < steady < gains.flops < 1.1 * steady  # events are few, see above
    data = as_data(gains)
    assert data["parts"][0]["work"] == "servo computers" and data["flops"] == gains.flops


def test_code_that_is_timed_alone_computes_the_same_bits() -> None:
    """What `profile` compiles is not inlined, so that its time is its own; nothing else is different."""
    asked = experiment("two_link.ic", "nominal")
    recording = record(build(asked))
    cases = np.empty((1, 0))
    inlined, alone = (kernel.from_recording(recording, inline=inline).run(cases, 100) for inline in (True, False))
    assert all(np.array_equal(a, b) for a, b in zip(inlined, alone, strict=True))
