"""An arm is resolved once for all runs and sweeps that have it as it is written."""

from __future__ import annotations

import pytest

from ic.driver.compile import Compiled, check
from ic.meaning.mechanics import arm as arms
from met.plan.file import dumps
from tests.ic.driver.test_by_definition import ARM, RUN

MORE = """\
run heavier like slow { with heavy = 7 kg; }
run longer like slow { with links.boom.mass = 7 kg; }
sweep ratios of fast { vary drive.ratio = [40, 50]; }
"""


def compiled(text: str) -> Compiled:
    return check("", include_dirs=(), defines=(), select="all", text=text)


def test_only_what_changes_an_arm_resolves_it_again(monkeypatch: pytest.MonkeyPatch) -> None:
    resolved, times = arms._resolved, []
    monkeypatch.setattr(arms, "_resolved", lambda *given, **named: times.append(0) or resolved(*given, **named))
    assert compiled(ARM + RUN.replace("sweep masses", "// sweep masses")).plan is not None
    assert len(times) == 1
    times.clear()
    assert compiled(ARM + RUN + MORE[MORE.index("sweep") :]).plan is not None
    once, sweep_of_the_mass = 1, 1
    assert len(times) == once + sweep_of_the_mass


@pytest.mark.slow
def test_a_shared_arm_makes_the_plan_of_one_that_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    shared = compiled(ARM + RUN + MORE)
    monkeypatch.setattr(arms, "_shared", lambda scope, definition: None)
    alone = compiled(ARM + RUN + MORE)
    assert shared.plan is not None and alone.plan is not None
    assert dumps(shared.plan) == dumps(alone.plan)
    assert shared.diagnostics == alone.diagnostics


@pytest.mark.parametrize("old, new", [("5 kg", "5"), ("axis = z", "axis = w"), ("child = boom", "child = bom")])
def test_a_mistake_in_an_arm_is_told_once_and_as_if_arms_were_not_shared(
    old: str, new: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ARM + RUN + MORE).replace(old, new)
    shared = compiled(text)
    monkeypatch.setattr(arms, "_shared", lambda scope, definition: None)
    assert shared.plan is None
    assert shared.diagnostics == compiled(text).diagnostics
