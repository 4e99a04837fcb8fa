"""The Puma 560 and the Stanford arm that users copy from are the published ones, and meet their own requirements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ic
from ic.find import standard_decks
from met import run as engine
from met.diagnostic import Problem
from met.dynamics.kinematics import link_motions
from met.plan import Experiment
from met.program.system import System
from tests.oracles import denavit_hartenberg as dh
from tests.oracles.package import Package

pin = Package("pinocchio")

SEED = 560


@pytest.mark.parametrize(("deck", "rows", "kinds"), [
    ("puma_560.ic", dh.PUMA_CLASSIC, "RRRRRR"), ("stanford_arm.ic", dh.STANFORD, dh.STANFORD_KINDS),
])  # fmt: skip
def test_links_are_where_the_published_rows_have_them(deck: str, rows: tuple[dh.Row, ...], kinds: str) -> None:
    (made,) = ic.compile(deck).experiments
    tree = System(made).tree(lambda _: 0.0)
    for q in np.random.default_rng(SEED).uniform(-3.0, 3.0, (10, 6)):
        motions = link_motions(tree, tuple(q), (0.0,) * 6)
        for link, wanted in zip(made.structure.links, dh.poses("classic", rows, kinds, q), strict=True):
            pose = motions[link.name].pose
            # tens of roundings of lengths of metres
            np.testing.assert_allclose(np.array(pose.p, float), wanted[:3, 3], atol=1e-13)
            np.testing.assert_allclose(np.array(pose.R, float), wanted[:3, :3], atol=1e-13)


def passive_puma(folder: Path, q: np.ndarray, qd: np.ndarray) -> Experiment:
    (folder / "deck.ic").write_text("""
        #include <puma_560.ic>
        run fall { arm = puma_560; environment { gravity = [0, 0, -9.81] m/s^2; } rates { dynamics = 1 kHz; }
                   duration = 1 ms; record = [qdd]; }
        sweep states of fall { zip { """ + "".join(
        f"initial.{joint}.{what} = {values[:, i].tolist()} {unit};"
        for i, joint in enumerate(("waist", "shoulder", "elbow", "roll", "bend", "turn"))
        for what, values, unit in (("q", q, "rad"), ("qd", qd, "rad/s"))
    ) + "} }")  # fmt: skip
    return ic.compile(folder / "deck.ic", select=["states"]).experiments[0]


@pytest.mark.oracle
def test_the_puma_falls_as_pinocchio_built_from_the_published_tables(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    q, qd = rng.uniform(-2.5, 2.5, (8, 6)), rng.uniform(-1.0, 1.0, (8, 6))
    found = engine.run(passive_puma(tmp_path, q, qd)).signals["qdd"][:, 0]
    model = dh.model("classic", dh.PUMA_CLASSIC, "RRRRRR", dh.PUMA_BODIES)
    wanted = np.array([pin.aba(model, model.createData(), q[k], qd[k], np.zeros(6)) for k in range(8)])
    # rounding, times the condition number of a mass matrix of 5 kg m^2 at the waist and 4e-5 at the last joint
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-10 * np.abs(wanted).max(), err_msg=f"{SEED=}")


@pytest.mark.slow
@pytest.mark.parametrize("deck", ["puma_560.ic", "stanford_arm.ic"])
def test_the_decks_run_meets_its_requirements(deck: str) -> None:
    (made,) = ic.compile(deck).experiments
    result = engine.run(made)
    assert result.status.tolist() == [0] and (np.array(list(result.met.values())) == 1).all()


@pytest.mark.release
def test_the_standard_decks_can_be_included_together(tmp_path: Path) -> None:
    together = tmp_path / "all.ic"
    together.write_text("".join(f"#include <{each}>\n" for each in standard_decks()), encoding="utf-8")
    compiled = ic.check(together, select="all")
    assert compiled.plan is not None, compiled.diagnostics
    arms = {each.structure.arm for each in compiled.plan.experiments}
    assert arms == {
        "catcher",
        "ets_vii",
        "free_flyer",
        "manutec_r3",
        "manutec_r3_library",
        "manutec_r3_one_axis",
        "panda",
        "puma_560",
        "shuttle_arm",
        "shuttle_booms",
        "stanford_arm",
        "station_arm",
        "two_link",
    }


def test_of_decks_included_together_none_is_the_default_but_the_decks_own(tmp_path: Path) -> None:
    both = "#include <puma_560.ic>\n#include <stanford_arm.ic>\n"
    (tmp_path / "none.ic").write_text(both, encoding="utf-8")
    with pytest.raises(Problem) as caught:
        ic.compile(tmp_path / "none.ic")
    (told,) = caught.value.diagnostics
    assert (told.code, told.message) == (
        "D162",
        "this deck has 2 runs and sweeps, and several included files mark a `default`",
    )
    (made,) = ic.compile(text=both + "default run mine like puma_reach { duration = 1 s; }\n").experiments
    assert made.name == "mine"
