"""What is small of a tuning's cases where they are worth most moves as that worth; without slopes it goes without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from met.optimisers.descent import LocalModel
from met.plan.searches import Search, SearchedParameter
from met.searches import search_method, steps_of
from met.searches.robust import RobustTuning
from met.searches.slopes import WITHIN, CaseSlopes, local_model, worth_of
from met.searches.values import served

PARAMETERS = (SearchedParameter("drive.kp", 0.1, 10.0, True), SearchedParameter("drive.ki", -1.0, 3.0))


@dataclass(frozen=True)
class Limit:
    metric: str
    comparison: str
    limit: float


@dataclass
class Bowl:
    """A goal with its least at kp = 2, ki = the plant's number, and a metric `load`, kp + ki."""

    requirements: tuple[Limit, ...] = ()
    asked: int = 0

    def values(self, cases: np.ndarray) -> dict[str, np.ndarray]:
        kp, ki, plant = cases.T
        return {"settle": 1.0 + np.log(kp / 2.0) ** 2 + (ki - plant) ** 2, "load": kp + ki}

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        self.asked += 1
        kp, ki, plant = cases.T
        goal = np.stack([2.0 * np.log(kp / 2.0) / kp, 2.0 * (ki - plant)], axis=1)
        slopes = {"settle": goal, "load": np.ones_like(goal)}
        return CaseSlopes(np.ones(len(cases), bool), self.values(cases), slopes, {})

    def worth(self, cases: np.ndarray, search: Search) -> np.ndarray:
        values = self.values(cases)
        done = np.ones(len(cases), bool)
        return served(values["settle"], search.largest, done, self.requirements, values, search.margin)


class Refused(Bowl):
    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        self.asked += 1
        return "`settle` is a metric of a linear answer, which has no gradient"


def tuning(plants: tuple[float, ...] = (0.5, 0.7, 0.1), margin: float = 0.05) -> Search:
    return Search(
        "tune", "settle", False, PARAMETERS, 1000, against="spread", plants=tuple((each,) for each in plants),
        margin=margin, gradients=True,
    )  # fmt: skip


def run(search: Search, source: Bowl) -> tuple[RobustTuning, np.ndarray, np.ndarray]:
    method = search_method(search, source)
    assert isinstance(method, RobustTuning)
    cases, worth = [], []
    while len(asked := method.ask()):
        cases.append(asked)
        worth.append(source.worth(asked, search))
        method.tell(worth[-1])
    return method, np.concatenate(cases), np.concatenate(worth)


def test_what_is_to_be_small_is_the_worth_by_which_cases_are_ordered() -> None:
    """Of 200 random candidates that meet all, and of 200 that do not, the order is that of their worth, but for what a
    step keeps from a limit."""
    source, search = Bowl((Limit("load", "<", 3.0),)), tuning()
    draws, found = np.random.default_rng(1), dict[bool, list[tuple[float, float]]]()
    for _ in range(400):
        candidate = np.array([0.1 * 100.0 ** draws.random(), -1.0 + 4.0 * draws.random()])
        cases = np.array([[*candidate, *plant] for plant in search.plants])
        slopes = source.slopes(cases)
        assert isinstance(slopes, CaseSlopes)
        model = local_model(search, source.requirements, slopes, candidate)
        assert isinstance(model, LocalModel)
        worth = worth_of(search, source.requirements, slopes)
        assert worth == source.worth(cases, search).max()
        found.setdefault(worth >= 1.0, []).append((worth, model.value))
    for tier in found.values():
        assert len(tier) > 50
        by_worth, by_model = (np.argsort([pair[n] for pair in tier], kind="stable") for n in (0, 1))
        assert np.abs(np.array(tier)[by_worth, 1] - np.array(tier)[by_model, 1]).max() < 200 * WITHIN


@pytest.mark.parametrize("largest", [False, True])
@pytest.mark.parametrize("at", [(1.0, 0.2), (2.5, 0.45), (3.5, 1.0)], ids=["free", "near", "missed"])
def test_it_moves_as_the_slopes_say(at: tuple[float, float], largest: bool) -> None:
    """Along both parameters, by central differences over their shares of a range."""
    source, search = Bowl((Limit("load", "<", 3.0),)), replace(tuning((0.5,)), largest=largest)

    def model(shares: np.ndarray) -> LocalModel:
        candidate = np.array([0.1 * 100.0 ** shares[0], -1.0 + 4.0 * shares[1]])
        found = source.slopes(np.array([[*candidate, 0.5]]))
        assert isinstance(found, CaseSlopes)
        made = local_model(search, source.requirements, found, candidate)
        assert isinstance(made, LocalModel)
        return made

    share = np.array([np.log(at[0] / 0.1) / np.log(100.0), (at[1] + 1.0) / 4.0])
    here, near = model(share), 1e-5
    for number in range(2):
        step = near * np.eye(2)[number]
        above, below = model(share + step), model(share - step)
        assert here.piece_slopes[:, number] == pytest.approx((above.pieces - below.pieces) / (2 * near), abs=1e-6)
        assert here.hinge_slopes[:, number] == pytest.approx((above.hinges - below.hinges) / (2 * near), abs=1e-5)


def test_a_tuning_with_slopes_comes_nearer_in_fewer_cases() -> None:
    """The least worst is at kp = 2 in the middle of the outermost plants: 1 + 0.3^2."""
    search, source = tuning(), Bowl()
    method, cases, worth = run(search, source)
    _, without, worth_without = run(replace(search, gradients=False), Bowl())

    def best(cases: np.ndarray, worth: np.ndarray) -> float:
        _, of, tried = np.unique(cases[:, :2], axis=0, return_inverse=True, return_counts=True)
        worst = np.full(len(tried), -np.inf)
        np.maximum.at(worst, of.ravel(), worth)
        least = worst[tried == 3].min()
        return float(least / (1.0 - least))

    fewer = len(without) * 3 // 4
    assert best(cases[:fewer], worth[:fewer]) == pytest.approx(1.09, rel=1e-5)
    assert best(cases[:fewer], worth[:fewer]) <= best(without, worth_without)
    assert steps_of(method) == {"along_slopes": method.steps.cases if method.steps else -1, "without_slopes": ""}
    assert 0 < steps_of(method)["along_slopes"] <= source.asked * 3


class Valleys(Bowl):
    """A goal that falls from near the middle to a corner of the ranges, and farther in a narrow valley elsewhere."""

    def values(self, cases: np.ndarray) -> dict[str, np.ndarray]:
        kp, ki, _ = cases.T
        x = np.log10(kp)
        wide = 2.0 - x / 2.0 - ki / 6.0
        narrow = 0.8 + 8.0 * ((x + 0.5) ** 2 + (ki - 0.2) ** 2)
        return {"settle": np.minimum(wide, narrow), "load": kp + ki}

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        kp, ki, _ = cases.T
        x = np.log10(kp)
        wide = np.stack([-0.5 * np.ones_like(x), -np.ones_like(x) / 6.0], axis=1)
        narrow = np.stack([16.0 * (x + 0.5), 16.0 * (ki - 0.2)], axis=1)
        values = self.values(cases)
        in_narrow = (values["settle"] < 2.0 - x / 2.0 - ki / 6.0)[:, None]
        by_kp = np.where(in_narrow, narrow, wide) / np.stack([kp * np.log(10.0), np.ones_like(kp)], axis=1)
        slopes = {"settle": by_kp, "load": np.ones_like(by_kp)}
        return CaseSlopes(np.ones(len(cases), bool), values, slopes, {})


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_cases_that_are_left_at_a_corner_go_into_fresh_beginnings(seed: int) -> None:
    """At the corner the goal is 1, and 0.8 in the narrow valley. What the first beginning missed the next may find."""
    search = replace(tuning((0.5,)), seed=seed, at_most=400)
    _, cases, worth = run(search, Valleys())
    _, _, worth_without = run(replace(search, gradients=False), Valleys())
    assert 380 <= len(cases) <= 400
    assert worth.min() <= worth_without.min()
    if seed in (0, 4):
        early, late = (float(least / (1.0 - least)) for least in (worth[:170].min(), worth.min()))
        assert early == pytest.approx(1.0, rel=1e-5) and late == pytest.approx(0.8, rel=1e-5)


@pytest.mark.slow
def test_a_limit_is_kept_and_a_margin_is_paid_for() -> None:
    """kp + ki < 2 cuts the bowl's floor off: its margin's edge, at 1.9, costs less than 5 % of the goal."""
    search, source = tuning((0.5,)), Bowl((Limit("load", "<", 2.0),))
    _, cases, worth = run(search, source)
    best = cases[int(np.argmin(worth))]
    assert best[0] + best[1] == pytest.approx(1.9, abs=1e-3)
    kp = np.linspace(0.5, 3.0, 200001)
    edge = 1.0 + np.log(kp / 2.0) ** 2 + (1.9 - kp - 0.5) ** 2
    least = float(worth.min() / (1.0 - worth.min()))
    assert least == pytest.approx(edge.min(), rel=1e-4)


@dataclass
class Steered(Bowl):
    """A bowl whose worth also asks for a load below 2.2, which has no slopes, as a least margin has none."""

    beyond: int = 0

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        self.beyond += bool((self.values(cases)["load"] > 2.2).any())
        return super().slopes(cases)

    def worth(self, cases: np.ndarray, search: Search) -> np.ndarray:
        values, limits = self.values(cases), (*self.requirements, Limit("load", "<", 2.2))
        return served(values["settle"], search.largest, np.ones(len(cases), bool), limits, values, search.margin)


def test_steps_along_slopes_stay_within_a_margin_that_steers() -> None:
    """Slopes beyond it are asked for where a descent begins alone, and the answer lies on its edge."""
    search = replace(tuning((0.5,), margin=0.0), steers=True)
    source = Steered()
    method, cases, worth = run(search, source)
    assert method.steps is not None and method.steps.cases > 20 and 0 < source.asked < 0.6 * method.steps.cases
    assert source.beyond <= 1
    best = cases[worth.argmin()]
    edge = np.linspace(1.0, 2.2, 100_001)  # kp, with ki = 2.2 - kp
    least = float((1.0 + np.log(edge / 2.0) ** 2 + (1.7 - edge) ** 2).min())
    assert source.values(best[None])["settle"][0] < least * (1.0 + 1e-3)


def test_where_there_are_no_slopes_it_goes_on_without_and_says_why() -> None:
    method, cases, _ = run(tuning(), Refused())
    assert steps_of(method) == {
        "along_slopes": 0,
        "without_slopes": "`settle` is a metric of a linear answer, which has no gradient",
    }
    assert 500 < len(cases) <= 1000


def test_gradients_that_are_off_are_not_asked_for() -> None:
    source = Bowl()
    method, _, _ = run(replace(tuning(), gradients=False), source)
    assert source.asked == 0 and steps_of(method) == {}


def broken(change: Callable[[CaseSlopes], CaseSlopes], limits: tuple[Limit, ...] = ()) -> LocalModel | str:
    source = Bowl(limits)
    found = source.slopes(np.array([[1.0, 0.3, 0.5]]))
    assert isinstance(found, CaseSlopes)
    return local_model(tuning((0.5,)), limits, change(found), np.array([1.0, 0.3]))


def test_why_there_is_no_slope_is_told() -> None:
    no, none = np.full((1, 2), np.nan), np.array([np.nan])
    near, far = (Limit("load", "<", 1.31),), (Limit("load", "<", 5.0),)
    why = {"settle": "`settle`: on an edge", "load": "`load`: on an edge"}

    def without(name: str) -> Callable[[CaseSlopes], CaseSlopes]:
        return lambda found: replace(found, slopes={**found.slopes, name: no}, why_not=why)

    assert broken(lambda found: replace(found, done=np.zeros(1, bool))) == "a case fails"
    assert broken(without("settle")) == "`settle`: on an edge"
    assert broken(lambda found: replace(found, values={**found.values, "settle": none})) == "`settle` has no value"
    assert broken(without("load"), near) == "`load`: on an edge"
    assert isinstance(broken(without("load"), far), LocalModel), "far inside its limit it does not matter how it moves"
