"""docs/python.md: what it shows is what Python says, and its environment for learners is one."""

from __future__ import annotations

import doctest
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_shows_what_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    session = "\n".join(re.findall(r"```pycon\n(.*?)```", PAGE, re.DOTALL))
    test = doctest.DocTestParser().get_doctest(session, {}, "python.md", "python.md", 0)
    told: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(test, out=told.append)
    assert result.attempted > 12 and not result.failed, "".join(told)
    assert not list(tmp_path.iterdir())


class Env:
    """What of gymnasium.Env the page's environment uses."""

    def reset(self, *, seed: int | None = None, options: object = None) -> None:
        self.np_random = np.random.default_rng(seed)


class Box(SimpleNamespace):
    """A box of numbers, as gymnasium.spaces.Box is called."""

    def __init__(self, low: float, high: float, shape: tuple[int, ...], dtype: Any) -> None:
        super().__init__(low=low, high=high, shape=shape, dtype=dtype)


def stand_in() -> ModuleType:
    """A module in gymnasium's place."""
    module = ModuleType("gymnasium")
    module.__dict__.update(Env=Env, spaces=SimpleNamespace(Box=Box))
    return module


@pytest.fixture
def reach(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The page's environment; of gymnasium itself where it is installed."""
    try:
        import gymnasium  # noqa: F401
    except ImportError:
        monkeypatch.setitem(sys.modules, "gymnasium", stand_in())
    [source] = re.findall(r"<!-- reach.py -->\n```python\n(.*?)```", PAGE, re.DOTALL)
    names: dict[str, Any] = {"__name__": "reach"}
    exec(compile(source, "reach.py", "exec"), names)
    return names["Reach"]()


@pytest.mark.slow
def test_its_environment_goes_through_an_episode(reach: Any) -> None:
    seen, _ = reach.reset(seed=3)
    assert seen.shape == reach.observation_space.shape and seen.dtype == reach.observation_space.dtype
    before, steps, over = -np.inf, 0, False
    while not over:
        q, target = seen[:2], seen[4:]
        bend = np.arccos(target @ target / 8.0 - 1.0)  # of the elbow, where both links are 2 m
        wanted = np.array([np.arctan2(target[1], target[0]) - bend / 2.0, bend])
        seen, reward, arrived, ended, more = reach.step(np.clip(wanted - q, -0.1, 0.1))
        steps, over = steps + 1, arrived or ended
        before = max(before, reward)
    assert arrived and not ended and more["cause"] == "" and 10 < steps < 500
    assert reward == before > -0.02


def test_equal_seeds_give_equal_episodes(reach: Any) -> None:
    def episode(seed: int) -> list[float]:
        first, _ = reach.reset(seed=seed)
        rewards = [reach.step(np.array([0.02, -0.03]))[1] for _ in range(20)]
        return [*first.tolist(), *rewards]

    assert episode(1) == episode(1) != episode(2)


@pytest.mark.slow
def test_an_episode_is_cut_at_the_runs_end(reach: Any) -> None:
    reach.reset(seed=1)
    ends = [reach.step(np.zeros(2))[2:4] for _ in range(500)]
    assert ends[-1] == (False, True) and set(ends[:-1]) == {(False, False)}
