"""`sample random(until_shown, at_most = N)`: the draws of `random(N)`; what would make it show nothing is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met.plan import Experiment
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, experiment, messages

REQUIRED = "require top < 2 rad/s in 95 % of cases with 90 % confidence;"
MASS = "links.bar.mass = uniform(1, 3) kg;"
EARLY = f"sample random(until_shown, at_most = 100) {{ {MASS} }}"


def of_run(required: str) -> str:
    return changed(RUN, ("record = [q]", f"metric top = max {{ of = hinge.qd; }} {required} record = [q]"))


def shown(folder: Path, sweep: str, required: str = REQUIRED, before: str = "") -> str:
    return messages(
        check(folder, before, ARM, SERVO, of_run(required), f"sweep it of hold {{ {sweep} }}\n", select=["it"])
    )


def made(folder: Path, sweep: str, before: str = "") -> Experiment:
    return experiment(folder, before, ARM, SERVO, of_run(REQUIRED), f"sweep it of hold {{ {sweep} }}\n", select=["it"])


def test_the_cases_are_those_of_a_number_of_samples(tmp_path: Path) -> None:
    vary = "vary drive.kp = [1, 2] V*s/rad;"
    early = made(tmp_path, f"{vary} {EARLY}")
    fixed = made(tmp_path, f"{vary} sample random(100) {{ {MASS} }}")
    longer = made(tmp_path, f"{vary} {EARLY.replace('100', '250')}")
    assert (early.cases.until_shown, fixed.cases.until_shown, longer.cases.until_shown) == (100, 0, 250)
    for one, other, more in zip(
        early.cases.coordinates, fixed.cases.coordinates, longer.cases.coordinates, strict=True
    ):
        assert (one.values == other.values).all()
        assert (more.values.reshape(2, 250)[:, :100] == one.values.reshape(2, 100)).all()


def test_the_notes_say_where_it_stops_at_the_earliest(tmp_path: Path) -> None:
    notes = made(tmp_path, EARLY).notes
    assert "sample random(until_shown, at_most = 100), seed 0" in notes
    assert "cases for a confidence: stops at 53 cases for each design point if none misses; at most 100" in notes


def test_it_stops_when_the_last_of_its_requirements_may_be_shown(tmp_path: Path) -> None:
    both = f"{REQUIRED} require percentile(top, 99 %) < 3 rad/s with 95 % confidence;"
    said = shown(tmp_path, EARLY.replace("100", "400"), both)
    assert said == ""
    found = experiment(
        tmp_path, ARM, SERVO, of_run(both), f"sweep it of hold {{ {EARLY.replace('100', '400')} }}\n", select=["it"]
    )
    assert any(note.startswith("cases for a confidence: stops at 344 cases for") for note in found.notes), found.notes


def test_too_few_at_most_are_told_of(tmp_path: Path) -> None:
    said = shown(tmp_path, EARLY.replace("100", "52"), f"\n{REQUIRED}\n")
    assert said == (
        "warning[D352]: 52 cases at most cannot show this, were it met by all of them\n"
        "  --> deck.ic:17:1\n"
        "   |\n"
        f"17 | {REQUIRED}\n"
        "   | ^^^^^^^\n"
        "   = help: write `at_most = 53` or more; 111 show it where one misses it\n\n1 warning\n"
    )
    assert shown(tmp_path, EARLY.replace("100", "53")) == ""


def test_a_sample_without_its_most_cases_is_told_how_it_is_written(tmp_path: Path) -> None:
    assert shown(tmp_path, f"\n{EARLY.replace(', at_most = 100', '')}\n") == (
        "error[D224]: `until_shown` takes the most cases of a design point, `at_most`, and nothing else\n"
        "  --> deck.ic:19:15\n"
        "   |\n"
        f"19 | sample random(until_shown) {{ {MASS} }}\n"
        "   |               ^^^^^^^^^^^\n"
        "   = help: write `sample random(until_shown, at_most = 50000) { ... }`\n\n1 error\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize(("sweep", "code", "part"), [
    (EARLY.replace(", at_most = 100", ""), "D224", "`until_shown` takes the most cases of a design point, `at_most`"),
    (EARLY.replace("100", "100, by = 3"), "D224", "`until_shown` takes the most cases of a design point, `at_most`"),
    (EARLY.replace("until_shown", "50"), "D224", "`at_most` goes with `until_shown`, and not with a number"),
    (EARLY.replace("until_shown, ", ""), "D224", "`at_most` goes with `until_shown`, and not with a number"),
    (EARLY.replace("100", "2.5"), "D113", "whole number"),
    (EARLY.replace("random", "lhs"), "D351", "`lhs` does not draw cases each without regard to the others"),
    (EARLY.replace("random", "sobol"), "D351", "`sobol` does not draw cases each without regard to the others"),
    (f"sample random(3) {{ drive.kp = uniform(1, 2) V*s/rad; }} {EARLY}", "D351", "the cases of two samples share"),
    (f"sample lhs(3) {{ drive.kp = uniform(1, 2) V*s/rad; }} {EARLY}", "D351", "`lhs` does not draw cases"),
    (f"{EARLY} vary drive.kp = [1, 2] V*s/rad;", "D358", "so `until_shown` stands last"),
    (f"{EARLY} vary integrator = [rk4, midpoint];", "D358", "so `until_shown` stands last"),
])  # fmt: skip
def test_what_gives_no_confidence_or_no_order_is_refused(tmp_path: Path, sweep: str, code: str, part: str) -> None:
    said = shown(tmp_path, sweep)
    assert said.startswith(f"error[{code}]") and part in said and said.endswith("\n1 error\n"), said
    assert "\n --> " in said.replace("  --> ", " --> ")


def test_repeats_share_the_draws_of_their_case(tmp_path: Path) -> None:
    noisy = changed(SERVO, ("}", "sensor qd = tachometer { noise = 0.01 rad/s; } }"))
    sweep = f"sweep it of hold {{ {EARLY} repeat 3; }}\n"
    said = messages(check(tmp_path, ARM, noisy, of_run(REQUIRED), sweep, select=["it"]))
    assert said.startswith("error[D351]: the repeats of a case share its draws") and said.endswith("\n1 error\n"), said


@pytest.mark.parametrize("required", ["", "require top < 2 rad/s;", "require top < 2 rad/s in 95 % of cases;"])
def test_without_a_confidence_nothing_is_to_be_shown(tmp_path: Path, required: str) -> None:
    said = shown(tmp_path, EARLY, required)
    assert said.startswith("error[D357]: no requirement of `it` has a confidence") and said.endswith("\n1 error\n"), (
        said
    )


def test_lists_files_and_exclusions_choose_design_points_before_it(tmp_path: Path) -> None:
    (tmp_path / "gains.csv").write_text("drive.kp [V*s/rad],drive.ki [V/rad]\n1,2\n2,3\n3,4\n", encoding="utf-8")
    found = made(
        tmp_path, f'from "gains.csv"; {EARLY} exclude when drive.kp > 2.5 V*s/rad; exclude when links.bar.mass > 2 kg;'
    )
    kept = {each.path: each.values for each in found.cases.coordinates}
    assert set(kept["drive.kp"]) == {1.0, 2.0} and kept["links.bar.mass"].max() <= 2.0
    assert found.cases.until_shown == 100 and found.cases.count == 2 * int((kept["drive.kp"] == 1.0).sum())
    assert (np.diff(kept["drive.kp"]) >= 0.0).all()


def test_a_value_that_a_deck_has_under_that_name_is_still_a_number(tmp_path: Path) -> None:
    found = made(tmp_path, f"sample random(until_shown) {{ {MASS} }}", before="let until_shown = 60;\n")
    assert (found.cases.count, found.cases.until_shown) == (60, 0)
    found = made(tmp_path, EARLY.replace("100", "most"), before="let until_shown = 60; let most = 70;\n")
    assert (found.cases.count, found.cases.until_shown) == (70, 70)
