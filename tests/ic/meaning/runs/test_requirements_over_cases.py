"""Requirements over a share of cases: how a deck writes them, what a plan keeps of them, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ic.meaning.runs.requirements import SHARE
from met.plan import file as plan_file
from met.plan.judged import Requirement
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, experiment, messages

METRICS = "metric top = max { of = hinge.qd; } metric far = max { of = hinge.q; }"
DRAWN = "sample random(300) { links.bar.mass = uniform(1, 3) kg; }"


def run(*requirements: str) -> str:
    return changed(RUN, ("record = [q]", f"{METRICS} {' '.join(requirements)} record = [q]"))


def required(folder: Path, *requirements: str) -> tuple[Requirement, ...]:
    return experiment(folder, ARM, SERVO, run(*requirements)).requirements


def shown(folder: Path, *requirements: str, sweep: str = "") -> str:
    if not sweep:
        return messages(check(folder, ARM, SERVO, run(*requirements)))
    return messages(check(folder, ARM, SERVO, run(*requirements), f"sweep it of hold {{ {sweep} }}\n", select=["it"]))


@pytest.mark.parametrize(("written", "share", "confidence"), [
    ("require top < 2 rad/s;", None, None),
    ("require top < 2 rad/s in 95 % of cases;", 0.95, None),
    ("require top < 2 rad/s in 99.73 % of cases with 90 % confidence;", 0.9973, 0.9),
    ("require top < 2 rad/s in 0.95 of cases with 0.9 confidence;", 0.95, 0.9),
    ("require 2 rad/s > top in 95 % of cases;", 0.95, None),
    ("require percentile(top, 95 %) < 2 rad/s;", 0.95, None),
    ("require 2 rad/s >= percentile(top, 95 %) with 90 % confidence;", 0.95, 0.9),
    ("require percentile(top, 5 %) > 2 rad/s with 90 % confidence;", 0.95, 0.9),
])  # fmt: skip
def test_share_and_confidence_as_they_may_be_written(
    tmp_path: Path, written: str, share: float | None, confidence: float | None
) -> None:
    [found] = required(tmp_path, written)
    assert found.metric == "top" and found.limit == 2.0
    assert (
        found.share == (None if share is None else pytest.approx(share, rel=1e-15)) and found.confidence == confidence
    )
    assert found.text == written.removeprefix("require ").removesuffix(";")


def test_a_share_may_be_named(tmp_path: Path) -> None:
    deck = run("require top < 2 rad/s in most of cases with sure confidence;")
    found = experiment(tmp_path, "let most = 95 %; let sure = 0.9;", ARM, SERVO, deck).requirements
    assert (found[0].share, found[0].confidence) == (0.95, 0.9)


def test_a_bare_limit_before_in_is_no_number_of_inches(tmp_path: Path) -> None:
    deck = changed(run(), ("record = [q]", "metric past = overshoot { of = hinge.q; target = 1 rad; } "
                                     "require past < 2 in 95 % of cases; record = [q]"))  # fmt: skip
    assert experiment(tmp_path, ARM, SERVO, deck).requirements[0].limit == 2.0


def test_a_plan_file_keeps_them_and_one_without_is_as_before() -> None:
    import ic

    for number, written in enumerate(["require top < 2 rad/s;", "require top < 2 rad/s in 95 % of cases;"]):
        plan = ic.compile(text=ARM + SERVO + run(written))
        text = plan_file.dumps(plan)
        assert plan_file.loads(text).experiments[0].requirements == plan.experiments[0].requirements
        [kept] = json.loads(text)["experiments"][0]["requirements"]
        assert ("share" in kept) == (number == 1) and "confidence" not in kept


@pytest.mark.parametrize(("field", "value"), [("share", 0.0), ("share", 1.5), ("confidence", 1.0), ("confidence", 0.9)])
def test_a_plan_file_with_a_share_that_cannot_be_is_damaged(field: str, value: float) -> None:
    import ic
    from met.diagnostic import Problem

    data = json.loads(plan_file.dumps(ic.compile(text=ARM + SERVO + run("require top < 2 rad/s;"))))
    data["experiments"][0]["requirements"][0][field] = value
    with pytest.raises(Problem) as raised:
        plan_file.loads(json.dumps(data))
    assert f"requirements[0].{field}" in str(raised.value)


@pytest.mark.parametrize(("requirement", "code", "part"), [
    ("require top < 2 rad/s in 95 % of case;", "D020", "expected `cases`"),
    ("require top < 2 rad/s in 95 %;", "D020", "expected `of`"),
    ("require top < 2 rad/s with 95 %;", "D020", "expected `confidence`"),
    ("require top < 2 rad/s in 95 % of cases with 90 % trust;", "D020", "expected `confidence`"),
    ("require top < 2 rad/s with 90 % confidence;", "D350", "without the share"),
    ("require top < 2 rad/s in 0 % of cases;", "D077", "share"),
    ("require top < 2 rad/s in 101 % of cases;", "D077", "share"),
    ("require top < 2 rad/s in 95 % of cases with 100 % confidence;", "D077", "confidence"),
    ("require percentile(top, 100 %) < 2 rad/s;", "D077", "share"),
    ("require percentile(top, 95 %) < 2 rad/s in 95 % of cases;", "D350", "in its brackets"),
    ("require percentile(top) < 2 rad/s;", "D350", "of a metric and a share"),
    ("require percentile(tip, 95 %) < 2 rad/s;", "D132", "no metric `tip`"),
    ("require top < 2 rad/s in 100 % of cases with 90 % confidence;", "D350", "no number of cases"),
    ("require top < 2 rad/s in 99.99999999999 % of cases with 90 % confidence;", "D350", "so near to all or none"),
    ("require percentile(top, 1e-10 %) > 2 rad/s with 90 % confidence;", "D350", "so near to all or none"),
    ("require top < 2 rad/s in 3 kg of cases;", "D06", "share"),
])  # fmt: skip
def test_what_cannot_be_is_told(tmp_path: Path, requirement: str, code: str, part: str) -> None:
    said = shown(tmp_path, requirement)
    assert said.startswith(f"error[{code}") and part in said and said.endswith("\n1 error\n"), said


def test_a_share_that_no_campaign_shows_is_underlined(tmp_path: Path) -> None:
    share = "99.99999999999 %"
    said = shown(tmp_path, f"require top < 2 rad/s in {share} of cases with 90 % confidence;").splitlines()
    (line,) = (number for number, text in enumerate(said) if share in text and "|" in text)
    assert said[line + 1].index("^") == said[line].index(share) and said[line + 1].count("^") == len(share)


CONFIDENT = "require top < 2 rad/s in 99 % of cases with 90 % confidence;"


@pytest.mark.parametrize(("sweep", "part"), [
    ("sample lhs(300) { links.bar.mass = uniform(1, 3) kg; }", "`lhs` does not draw cases"),
    ("sample saltelli(64) { links.bar.mass = uniform(1, 3) kg; drive.v_max = uniform(20, 30) V; }",
     "`saltelli` does not draw cases"),
    ("sample sobol(256) { links.bar.mass = uniform(1, 3) kg; }", "`sobol` does not draw cases"),
    (f"{DRAWN} sample random(2) {{ drive.kp = uniform(1, 2) V*s/rad; }}", "the cases of two samples share"),
])  # fmt: skip
def test_cases_that_give_no_confidence_are_refused(tmp_path: Path, sweep: str, part: str) -> None:
    said = shown(tmp_path, CONFIDENT, sweep=sweep)
    assert said.startswith("error[D351]") and part in said and said.endswith("\n1 error\n"), said


@pytest.mark.parametrize(
    "sweep", [DRAWN, f"vary drive.kp = [1, 2] V*s/rad; {DRAWN}", "vary drive.kp = [1, 2] V*s/rad;"]
)
def test_draws_and_lists_are_not_refused(tmp_path: Path, sweep: str) -> None:
    assert shown(tmp_path, CONFIDENT, sweep=sweep) == ""


def test_noise_has_to_be_drawn_for_each_case(tmp_path: Path) -> None:
    noisy = changed(SERVO, ("}", "sensor qd = tachometer { noise = 0.01 rad/s; } }"))
    for more, repeats, wanted in [
        ("", "", "error[D351]: all cases feel the same noise, and a confidence needs draws of their own"),
        ("seeds = independent;", "", ""),
        ("seeds = independent;", "repeat 3;", "error[D351]: the repeats of a case share its draws"),
    ]:
        sweep = f"sweep it of hold {{ {more} {DRAWN} {repeats} }}\n"
        said = messages(check(tmp_path, ARM, noisy, run(CONFIDENT), sweep, select=["it"]))
        assert said.startswith(wanted) and bool(said) == bool(wanted), said


def test_the_number_of_cases_is_that_of_the_smallest_design_point(tmp_path: Path) -> None:
    sweep = f"vary drive.kp = [1, 2] V*s/rad; {DRAWN} exclude when drive.kp > 1.5 V*s/rad and links.bar.mass > 2 kg;"
    said = shown(tmp_path, CONFIDENT, sweep=sweep)
    assert "warning[D352]: 1" in said and "draw 230 cases or more for each design point; 388 show it" in said


def test_the_share_has_the_bounds_of_its_declaration() -> None:
    assert (SHARE.above, SHARE.at_most) == (0.0, 1.0)
