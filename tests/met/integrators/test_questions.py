"""An integrator of somebody's own: whatever it does on its way, it runs as it should or its author is told."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import met.integrators
from met import models
from met import run as engine
from met.diagnostic import Problem
from met.integrators import modified_euler
from met.integrators.integrator import Integrator, Motion, Slope, ahead, by_parts, mean
from met.messages.render import render
from met.trace import Real, Scalar
from tests.ic.small_decks import ARM, RUN, SERVO, changed, experiment

Ask = Callable[[float, Motion], Slope]
STICKING = changed(SERVO, ("j_m = 1e-4 kg*m^2;", "j_m = 1e-4 kg*m^2; f_c = 0.01 N*m;"))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., np.ndarray]]:
    """Runs the small deck, which has friction, by an `advance` of the test's: positions."""

    def running(advance: Callable[..., Motion]) -> np.ndarray:
        own = Integrator(name="own", doc="Of this test.", order=2, real_limit=2.0, advance=advance)
        monkeypatch.setattr(met.integrators, "INTEGRATORS", (*met.integrators.INTEGRATORS, own))
        models.available.cache_clear()
        return engine.run(
            experiment(tmp_path, ARM, STICKING, changed(RUN, ("record = [q]", "record = [q]; integrator = own")))
        ).signals["q"]

    yield running
    monkeypatch.undo()
    models.available.cache_clear()


def said(problem: Problem) -> str:
    return render(problem.diagnostics, problem.sources)


def catching(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    try:
        k2 = slope(1.0, ahead(y, h, k1))
    except Exception:
        k2 = k1
    return ahead(y, h, mean(k1, k2))


def catching_all(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    try:
        k2 = slope(1.0, ahead(y, h, k1))
    except:  # noqa: E722
        k2 = k1
    return ahead(y, h, mean(k1, k2))


def dividing(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    k2 = slope(1.0, ahead(y, h, k1))
    return ahead(y, h + 0.0 / (1.0 + k1.qdd[0] - k1.qdd[0]), mean(k1, k2))


def by_weight(weight: float | None, slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    if weight is None:
        raise ValueError("no weight")
    return ahead(y, h, by_parts(lambda a, b: weight * (a + b), k1, slope(1.0, ahead(y, h, k1))))


@pytest.mark.slow
@pytest.mark.parametrize("advance", [catching, catching_all, dividing, partial(by_weight, 0.5)])
def test_what_an_integrator_catches_and_how_it_is_written_does_not_matter(run, advance) -> None:  # type: ignore[no-untyped-def]
    expected = run(modified_euler.advance)
    assert np.ptp(expected) > 0.0 and run(advance).tobytes() == expected.tobytes()


def by_kind(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    return ahead(y, h, slope(1.0, ahead(y, h, k1)) if isinstance(h, float) else k1)


def more_where_split(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    return ahead(y, h, k1 if isinstance(h, float) else slope(1.0, ahead(y, h, k1)))


def without_end(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    while True:
        k1 = slope(1.0, ahead(y, h, k1))


@pytest.mark.slow
@pytest.mark.parametrize("advance", [by_kind, more_where_split, without_end])
def test_the_number_of_slopes_is_the_same_at_all_times(run, advance) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(Problem) as problem:
        run(advance)
    assert (
        said(problem.value)
        == """\
error[E214]: integrator `own`: `advance` asks for more slopes at one time than at another
 = help: ask for the same number, at most 100, whatever the step's length is, and whether it is known
 = help: keep nothing from call to call: `advance` is called once for each slope that it asks for, and more

1 error
"""
    )


@pytest.mark.parametrize(
    ("gives", "what"),
    [
        (lambda slope, h, y, k1: None, "a NoneType, not a Motion"),
        (
            lambda slope, h, y, k1: Motion(y.q, (), y.x),
            "a Motion of 1 positions, 0 rates and 0 other states; the arm has 1 positions, 1 rates and 0 other states",
        ),
    ],
)
def test_what_is_no_state_of_the_arm_is_refused(run, gives, what) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(Problem) as problem:
        run(gives)
    assert said(problem.value) == (
        f"error[E214]: integrator `own`: `advance` gives back {what}\n"
        " = help: give back a state with all parts of the one it was given\n\n1 error\n"
    )


KEPT = SimpleNamespace(slope=None)


def keeping(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    before = KEPT.slope or k1
    KEPT.slope = k1 if isinstance(k1.qdd[0], Scalar) else None
    return ahead(y, h, mean(before, k1))


def asking_wrongly(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    return ahead(y, h, slope(1.0, y.q))  # type: ignore[arg-type]


def sharing_wrongly(slope: Ask, h: Real, y: Motion, k1: Slope) -> Motion:
    return ahead(y, h, slope("half", y))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("advance", "raised", "line"),
    [
        (keeping, "ValueError: two graphs meet in one operation", "mean(before, k1)"),
        (asking_wrongly, "TypeError: slope(c, y) was given a tuple, not a Motion", "slope(1.0, y.q)"),
        (sharing_wrongly, "TypeError: slope(c, y) was given a str for the share of the step", 'slope("half", y)'),
        (partial(by_weight, None), "ValueError: no weight", "raise ValueError"),
    ],
)
def test_what_an_integrator_raises_is_said_at_its_own_line(run, advance, raised, line) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(Problem) as problem:
        run(advance)
    (told,) = problem.value.diagnostics
    name = getattr(advance, "func", advance).__name__
    assert (told.code, told.message) == ("E213", f"integrator `own`: `{name}` raises {raised}")
    assert told.at is not None and told.at.place.file == __file__
    source = Path(__file__).read_text().splitlines()[told.at.place.line - 1]
    assert source[told.at.place.column - 1 :].startswith(line), source
