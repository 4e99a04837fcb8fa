"""Metrics of a window of the run: in plan and program only where a deck sets one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from met import run as engine
from met.run import Prepared
from tests.ic.small_decks import ARM, RUN, SERVO, changed, codes, experiment

WAVE = changed(SERVO, ("rate(0.1 rad/s)", "rate(sine(amplitude = 0.1 rad/s, frequency = 3 Hz))"))
MODELS = ("max", "min", "peak", "rms")


def watching(window: str) -> str:
    metrics = "".join(f"    metric {each} = {each} {{ of = hinge.qd;  {window} }}\n" for each in MODELS)
    return changed(RUN, ("record = [q];\n", f"record = [qd];\n{metrics}"), ("record = 100 Hz", "record = 1 kHz"))


def test_a_plan_has_a_window_only_where_a_deck_sets_one_and_the_whole_run_costs_nothing(tmp_path: Path) -> None:
    plain = experiment(tmp_path, ARM, WAVE, watching(""))
    assert not [path for path in plain.parameters if path.startswith("metrics.")]
    written = experiment(tmp_path, ARM, WAVE, watching("after = 0 s;"))
    assert {*written.parameters} - {*plain.parameters} == {f"metrics.{each}.after" for each in MODELS}
    assert Prepared(plain).code_key == Prepared(written).code_key


def test_a_window_is_of_its_samples_both_ends_among_them(tmp_path: Path) -> None:
    """Against the recorded samples: one window is constant, of the others each case has its own beginning."""
    sweep = "let start = 0.3 s;\nsweep begins of hold { vary start = [0, 0.3, 0.35, 2] s; }\n"
    constant = engine.run(experiment(tmp_path, ARM, WAVE, watching("after = 0.3 s;  within = 0.1 s;")))
    made = experiment(tmp_path, ARM, WAVE, sweep, watching("after = start;  within = 0.1 s;"), select=["begins"])
    found = engine.run(made)
    qd = constant.signals["qd"][0, :, 0]
    for case, first in enumerate((0, 300, 350)):
        seen = qd[first : first + 101]
        expected = {"max": seen.max(), "min": seen.min(), "peak": np.abs(seen).max(), "rms": np.sqrt((seen**2).mean())}
        for name in MODELS:
            assert abs(found.metrics[name][case] - expected[name]) < 1e-15, (name, first)
            assert first != 300 or constant.metrics[name][0] == found.metrics[name][case]
    assert all(np.isnan(found.metrics[name][3]) for name in MODELS), "no sample is after the end"


def test_a_window_beyond_the_run_is_warned_of_where_it_is_required(tmp_path: Path) -> None:
    for window, expected in (("after = 2 s;", ["D341"]), ("after = 0.5 s;  within = 1 s;", ["D341"]), ("", [])):
        run = changed(watching(window), ("record = [qd];", "record = [qd];\n    require max < 1 rad/s;"))
        assert codes(tmp_path, ARM, WAVE, run) == expected, window
