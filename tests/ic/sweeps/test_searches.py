"""Searches and tunings in a deck: what they become in a plan, and every refusal with its whole message."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.driver.compile import Compiled, check
from met.cli import main
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Plan
from met.plan import file as plan_file
from met.plan.checked_answers import check_search
from met.plan.codec import Damaged
from met.plan.searches import Confirmation, Search, SearchedParameter
from met.searches import search_method

DECK = """#include <servos/rigid_gearbox.ic>
arm swing {
    link bar { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive like rigid_gearbox { command = rate(0.1 rad/s); }
run hold {
    arm = swing;
    servos { hinge = drive; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 1 s;
    record = [q];
    metric last = final { of = hinge.q; }
    require last < 5 rad;
}
run other like hold { }
sweep loads of hold { vary links.bar.mass = [1, 2, 3] kg; }
"""
SEARCH = "search most of hold { maximise last;  drive.kp = between(0.01, 0.02) V*s/rad;  at_most = 100; }"
TUNE = (
    "tune gains of hold { choose drive.kp = logbetween(0.01, 0.1) V*s/rad;  against loads;  minimise last;  "
    "at_most = 90;  margin = 10 %;  seed = 4; }"
)


def compiled(folder: Path, text: str, name: str, **options: object) -> Compiled:
    (folder / "d.ic").write_text(DECK + text, encoding="utf-8")
    return check(folder / "d.ic", include_dirs=[], defines=[], select=[name], **options)  # type: ignore[arg-type]


def plan(folder: Path, text: str, name: str, **options: object) -> Plan:
    found = compiled(folder, text, name, **options)
    assert found.plan is not None, found.diagnostics
    return found.plan


def said(folder: Path, text: str, name: str = "most", **options: object) -> str:
    """What is said of a deck, its lines counted from what stands behind it."""
    found = compiled(folder, text, name, **options)
    return render(found.diagnostics, found.sources).replace(f"{folder}/", "")


# What they become


def test_a_search_is_a_sweep_whose_cases_are_its_first_generation(tmp_path: Path) -> None:
    [experiment] = plan(tmp_path, SEARCH, "most").experiments
    assert experiment.search == Search(
        "search", "last", True, (SearchedParameter("drive.kp", 0.01, 0.02, unit="V*s/rad"),), 100, "hold",
        place=experiment.search.place if experiment.search else None,
    )  # fmt: skip
    assert experiment.search is not None and not experiment.search.complete
    [coordinate] = experiment.cases.coordinates
    assert coordinate.path == "drive.kp" and coordinate.sets == ("hinge.servo.kp",)
    assert (np.asarray(coordinate.values) == search_method(experiment.search).ask()[:, 0]).all()


def test_a_tuning_has_the_cases_of_the_sweep_as_plants(tmp_path: Path) -> None:
    [experiment] = plan(tmp_path, TUNE, "gains").experiments
    search = experiment.search
    assert search is not None
    assert (search.kind, search.goal, search.at_most, search.seed, search.margin) == (
        "tune", "minimise last", 90, 4, 0.1,
    )  # fmt: skip
    assert search.against == "loads" and search.plants == ((1.0,), (2.0,), (3.0,))
    assert search.parameters == (SearchedParameter("drive.kp", 0.01, 0.1, True, "V*s/rad"),)
    assert [each.path for each in experiment.cases.coordinates] == ["drive.kp", "links.bar.mass"]
    assert set(np.asarray(experiment.cases.coordinates[1].values)) == {1.0}, "the first plant alone is active"


def test_a_plan_file_gives_it_back(tmp_path: Path) -> None:
    for text, name in ((SEARCH, "most"), (TUNE, "gains")):
        found = plan(tmp_path, text, name)
        plan_file.write(found, tmp_path / "p.json")
        assert plan_file.read(tmp_path / "p.json").experiments[0].search == found.experiments[0].search


def test_a_run_is_the_same_with_searches_beside_it(tmp_path: Path) -> None:
    one, other = (plan(tmp_path, text, "hold").experiments for text in ("", SEARCH + TUNE))
    assert one == other


@pytest.mark.slow
@pytest.mark.parametrize("name", ["search", "tune", "between", "choose", "against", "at_most", "margin", "maximise"])
def test_the_new_words_are_soft(tmp_path: Path, name: str) -> None:
    text = (
        f"let {name} = 3 kg;\nrun {name} like hold {{ }}\nsweep s_{name} of hold {{ vary links.bar.mass = [{name}]; }}"
    )
    assert plan(tmp_path, text, f"s_{name}").experiments[0].cases.count == 1
    assert plan(tmp_path, text, name).experiments[0].name == name


def test_what_is_set_is_not_chosen(tmp_path: Path) -> None:
    two = SEARCH.replace("at_most", "links.bar.mass = between(1, 3) kg;  at_most")
    [experiment] = plan(tmp_path, two, "most", settings=["drive.kp=0.015 V*s/rad"]).experiments
    assert experiment.search is not None
    assert [each.path for each in experiment.search.parameters] == ["links.bar.mass"]
    assert experiment.parameters["hinge.servo.kp"].value == 0.015


def test_shares_of_cases_count_in_each_case(tmp_path: Path) -> None:
    share = "run many like hold { require last > -1 rad in 99 % of cases with 90 % confidence; }\n"
    [experiment] = plan(tmp_path, share + SEARCH.replace("hold", "many"), "most").experiments
    assert [each.share for each in experiment.requirements] == [None, None]
    text = "last > -1 rad in 99 % of cases with 90 % confidence"
    words = f"`{text}` is of a share of cases, of which chosen cases show nothing: each is held against its limit"
    assert words in experiment.notes


def test_the_ends_of_what_is_chosen_are_checked_with_the_run(tmp_path: Path) -> None:
    text = SEARCH.replace("drive.kp = between(0.01, 0.02) V*s/rad", "links.bar.mass = between(-1e-4, 300) kg")
    found = said(tmp_path, text)
    assert "error[D077]: `mass` of link `bar` must be at least 0 kg; a case that may be chosen breaks it\n" in found
    assert "  = help: a case that may be chosen: links.bar.mass = -0.0001 kg\n" in found


@pytest.mark.slow
def test_the_commands_know_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.ic").write_text(f"{DECK}{SEARCH}\n{TUNE}\n", encoding="utf-8")
    assert main(["check", "d.ic"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "d.ic: 2 runs, 1 sweep, 1 search, 1 tuning, 195 cases: no errors"
    )
    assert main(["cases", "d.ic", "most"]) == 0
    assert capsys.readouterr().out.splitlines()[1] == (
        "  the first ones of a search, maximise last, in at most 100 cases: what they give decides those behind them"
    )
    assert main(["plan", "d.ic", "gains"]) == 0
    assert (
        "Tune: minimise last, in at most 90 cases; 808 B of histories a case\n"
        "  drive.kp  0.01 to 0.1 V*s/rad, by equal ratios\n"
        "  against 3 cases of loads: links.bar.mass\n"
        "  with a margin of 10 % to the limits of last < 5 rad\n"
    ) in capsys.readouterr().out
    assert main(["fmt", "d.ic", "--check"]) in (0, 1)
    assert main(["explain", "d.ic", "drive.kp", "--run", "most"]) == 0
    assert main(["doc", "tune"]) == 0


# What is refused


def lines(text: str) -> list[str]:
    """The lines of a message that say something: what, and the remedies."""
    return [line.strip() for line in text.splitlines() if line.startswith("error") or "= help" in line]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("maximise last;", "maximise last;  minimise last;", [
            "error[D362]: `most` has two goals", "= help: leave one out",
            "= help: what else matters is required in the run: `require METRIC < LIMIT;`"]),
        ("maximise last;", "", ["error[D362]: search `most` has no goal", "= help: write `maximise METRIC;`"]),
        ("maximise last;", "maximise hinge.q;", [
            "error[D362]: `maximise` takes the name of a metric", "= help: write `maximise METRIC;`",
            "= help: what is computed of several signals is a metric of an expression"]),
        ("maximise last", "maximise lasst", [
            "error[D362]: `most` goes by `lasst`, which is no metric of its run", "= help: did you mean `last`?",
            "= help: metrics of the run: last"]),
        ("at_most = 100;", "", [
            "error[D363]: search `most` does not say how many cases it may run",
            "= help: write `at_most = 2000;`: it never runs more"]),
        ("at_most = 100;", "at_most = 0;", [
            "error[D363]: `at_most` is a whole number of cases from 1 to 1,000,000",
            "= help: write `at_most = 2000;`"]),
        ("at_most = 100;", "at_most = 100;  at_most = 90;", [
            "error[D040]: `at_most` is written twice", "= help: leave one out"]),
        ("drive.kp = between(0.01, 0.02) V*s/rad;", "", [
            "error[D361]: search `most` chooses nothing", "= help: write `PATH = between(LOW, HIGH) UNIT;`"]),
        ("between(0.01, 0.02)", "between(0.02, 0.01)", [
            "error[D361]: `between` goes from a lower to a higher value",
            "= help: change the two about, or leave the parameter out where they are equal"]),
        ("between(0.01, 0.02)", "logbetween(0, 0.02)", [
            "error[D361]: the ends of a `logbetween` are both above or both below zero",
            "= help: `between` has no such limit"]),
        ("between(0.01, 0.02)", "between(-1e308, 1e308)", [
            "error[D361]: the ends of this `between` are too far apart: their difference is no number",
            "= help: take ends that a machine could have"]),
        ("between(0.01, 0.02)", "between(0.01)", [
            "error[D361]: `between` takes two numbers, the lower end and the higher",
            "= help: write `between(LOW, HIGH) UNIT`"]),
        ("between(0.01, 0.02)", "betwen(0.01, 0.02)", [
            "error[D361]: `drive.kp` is chosen between two ends", "= help: did you mean `between`?",
            "= help: write `drive.kp = between(LOW, HIGH) UNIT;`", "= help: ranges: between, logbetween"]),
        ("drive.kp = between(0.01, 0.02) V*s/rad", "drive.kp = 0.01 V*s/rad", [
            "error[D361]: `drive.kp` is chosen between two ends",
            "= help: write `drive.kp = between(LOW, HIGH) UNIT;`", "= help: ranges: between, logbetween"]),
        ("drive.kp = between(0.01, 0.02) V*s/rad", "rates.dynamics = between(1, 2) kHz", [
            "error[D361]: `rates.dynamics` decides the program, so that nothing chooses it between two ends",
            "= help: write a search for each, of runs that differ in it"]),
        ("drive.kp = between", "drive.kp = between(1, 2) V*s/rad;  drive.kp = between", [
            "error[D040]: `drive.kp` is chosen twice", "= help: leave one out"]),
        ("drive.kp", "drive.kpp", [
            "error[D128]: no parameter `drive.kpp` in this run", "= help: did you mean `drive.kp`?"]),
        ("at_most", "vary drive.ki = [1, 2] V/rad;  at_most", [
            "error[D360]: `vary drive.ki = ...` in a search",
            "= help: to choose it write `drive.ki = between(LOW, HIGH) UNIT;`",
            "= help: or set it in a run `like hold`"]),
        ("at_most", "require last < 1 rad;  at_most", [
            "error[D360]: no `require` in a search", "= help: it belongs to the run"]),
        ("at_most", "against loads;  at_most", [
            "error[D360]: no `against` in a search",
            "= help: a tuning is held against a sweep: `tune NAME of RUN { ... }`",
            "= help: a search chooses what is drawn, too: `PATH = between(LOW, HIGH) UNIT;`"]),
        ("drive.kp = between", "choose drive.kp = between", [
            "error[D360]: in a search this is written otherwise",
            "= help: write `drive.kp = between(0.01, 0.02) V*s/rad;`"]),
        ("search most of hold", "search most like hold", [
            "error[D049]: a search is `of` a run, other definitions are `like` another",
            "= help: write `search most of RUN { ... }`"]),
        ("search most of hold", "search loads of hold", [
            "error[D040]: sweep `loads` is written twice", "= help: remove one of the two"]),
        ("search most of hold", "serch most of hold", [
            "error[D045]: no kind of definition `serch`", "= help: did you mean `search`?",
            "= help: kinds: arm, servo, run, sweep, search, tune"]),
    ],
)  # fmt: skip
def test_a_search_that_is_none_is_refused(tmp_path: Path, old: str, new: str, message: list[str]) -> None:
    assert old in SEARCH
    found = lines(said(tmp_path, SEARCH.replace(old, new)))
    assert found[: len(message)] == message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("against loads", "against load", [
            "error[D041]: no sweep `load`", "= help: did you mean `loads`?", "= help: sweeps of this deck: loads"]),
        ("against loads", "against hold", ["error[D041]: no sweep `hold`", "= help: sweeps of this deck: loads"]),
        ("against loads", "against 3", [
            "error[D364]: `against` takes the name of a sweep", "= help: write `against SWEEP;`"]),
        ("tune gains of hold", "tune gains of other", [
            "error[D364]: sweep `loads` is of `hold`, and not of the run that is tuned",
            "= help: write a sweep of `other` with the cases that it must bear"]),
        ("choose drive.kp = logbetween(0.01, 0.1) V*s/rad", "choose links.bar.mass = between(1, 2) kg", [
            "error[D364]: `links.bar.mass` is chosen, and varies in `loads`",
            "= help: one parameter cannot be both: leave it out of one of the two"]),
        ("at_most = 90", "at_most = 12", [
            "error[D363]: 12 cases are too few to tune anything",
            "= help: 13 at least: 3 to try the best with each case of `loads`, and 10 to choose among; "
            "a thousand are no luxury"]),
        ("margin = 10 %", "gradients = maybe", [
            "error[D363]: a tuning's `gradients` are `on` or `off`",
            "= help: write `gradients = off;`"]),
        ("margin = 10 %", "margin = 100 %", [
            "error[D363]: a margin is a share of a limit, from 0 % to less than 100 %",
            "= help: write `margin = 5 %;`"]),
        *[("margin = 10 %", f"least_margin = {text}", [
            "error[D363]: a least margin is a disk margin, from 0 to less than 2",
            "= help: write `least_margin = 0.5;`: 0.3 is a gain of 1.35 times, 0.67 of 2 times",
            "= help: 0 asks for none"])
          for text in ("2", "-0.1", "1e308", "0.5 rad")],
        ("margin = 10 %", "least_margin = 0.5;  least_margin = 0.5", [
            "error[D040]: `least_margin` is written twice", "= help: leave one out"]),
        ("choose drive.kp", "drive.kp", [
            "error[D360]: in a tune this is written otherwise",
            "= help: write `choose drive.kp = logbetween(0.01, 0.1) V*s/rad;`"]),
        ("choose drive.kp = logbetween(0.01, 0.1) V*s/rad;", "", [
            "error[D361]: tune `gains` chooses nothing", "= help: write `choose PATH = between(LOW, HIGH) UNIT;`"]),
        ("minimise last;", "", ["error[D362]: tune `gains` has no goal", "= help: write `minimise METRIC;`"]),
    ],
)  # fmt: skip
def test_a_tuning_that_is_none_is_refused(tmp_path: Path, old: str, new: str, message: list[str]) -> None:
    assert old in TUNE
    found = lines(said(tmp_path, TUNE.replace(old, new), "gains"))
    assert found[: len(message)] == message


DRAWN = """
sweep drawn of hold { sample random(4) { links.bar.mass = uniform(1, 3) kg;  drive.kt = uniform(0.05, 0.06) N*m/A; } }
sweep fresh of hold { sample random(7) { drive.kt = uniform(0.05, 0.06) N*m/A;  links.bar.mass = uniform(1, 3) kg; } }
sweep seeded of hold {
    seed = 3;  sample random(4) { links.bar.mass = uniform(1, 3) kg;  drive.kt = uniform(0.05, 0.06) N*m/A; }
}
"""
OWN = "a sweep that writes no `seed` is drawn anew for `confirm`, even the one that the tuning is against"


def confirmed(by: str, against: str = "against drawn;", at_most: int = 90) -> str:
    words = f"{against}  confirm {by};".lstrip()
    return DRAWN + TUNE.replace("against loads;", words).replace("at_most = 90", f"at_most = {at_most}")


@pytest.mark.parametrize("by", ["fresh", "drawn"])
def test_a_tuning_is_confirmed_by_what_its_sweep_draws_with_the_next_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], by: str
) -> None:
    """In the order of what it is against; these cases are none that it may spend before."""
    [experiment] = plan(tmp_path, confirmed(by), "gains").experiments
    search = experiment.search
    assert search is not None and search.confirms == by and search.budget == 90 - len(search.fresh)
    again = ic.compile(tmp_path / "d.ic", select=[by], set={"seed": 1}).experiments[0].cases.coordinates
    columns = {each.path: np.asarray(each.values) for each in again}
    assert search.fresh == tuple(zip(columns["links.bar.mass"].tolist(), columns["drive.kt"].tolist(), strict=True))
    plan_file.write(ic.compile(tmp_path / "d.ic", select=["gains"]), tmp_path / "p.json")
    assert plan_file.read(tmp_path / "p.json").experiments[0].search == search
    assert main(["plan", str(tmp_path / "d.ic"), "gains"]) == 0
    assert f"\n  confirmed by {len(search.fresh)} cases of {by}\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (confirmed("3"), ["error[D364]: `confirm` takes the name of a sweep", "= help: write `confirm SWEEP;`"]),
        (confirmed("fresh;  confirm drawn"), ["error[D040]: `confirm` is written twice", "= help: leave one out"]),
        (confirmed("fresh", ""), [
            "error[D364]: `fresh` does not vary what the tuning is against", "= help: write `against SWEEP;`"]),
        (confirmed("loads"), [
            "error[D364]: `loads` does not vary what the tuning is against",
            "= help: write a sample of `links.bar.mass`, `drive.kt`"]),
        (confirmed("loads", "against loads;"), [
            "error[D364]: nothing is drawn in `loads`, so that it confirms nothing",
            "= help: write a sample in it", f"= help: {OWN}"]),
        (confirmed("seeded", "against seeded;"), [
            "error[D364]: cases of `seeded` are among those that choose the design", f"= help: {OWN}"]),
        (confirmed("fresh", at_most=20), [
            "error[D363]: 20 cases are too few to tune anything",
            "= help: 21 at least: 7 to confirm it, 4 to try the best with each case of `drawn`, and 10 to choose "
            "among; a thousand are no luxury"]),
    ],
)  # fmt: skip
def test_a_tuning_is_confirmed_by_cases_that_did_not_choose_it(tmp_path: Path, text: str, message: list[str]) -> None:
    found = lines(said(tmp_path, text, "gains"))
    assert found[: len(message)] == message


def test_a_case_that_confirms_is_one_that_can_be_run(tmp_path: Path) -> None:
    wrong = confirmed("fresh").replace("uniform(1, 3) kg; } }\nsweep seeded", "uniform(-3, -1) kg; } }\nsweep seeded")
    assert "mass" in said(tmp_path, wrong, "gains")


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"confirms": ""}, "fresh"), ({"fresh": ()}, "fresh"), ({"fresh": ((1.0,),)}, r"plants\[4\]"),
        ({"at_most": 20}, "at_most"), ({"confirmation": (Confirmation("fresh", 7, 0, 0, 1.0),)}, "confirmation"),
    ],
)  # fmt: skip
def test_a_plan_that_is_confirmed_by_no_cases_is_refused(tmp_path: Path, change: dict[str, object], where: str) -> None:
    [experiment] = plan(tmp_path, confirmed("fresh"), "gains").experiments
    assert experiment.search is not None
    with pytest.raises(Damaged, match=rf"search\.{where}: "):
        check_search(experiment, replace(experiment.search, **change), "search")  # type: ignore[arg-type]


def test_a_sweep_that_varies_nothing_is_refused_once(tmp_path: Path) -> None:
    text = f"sweep odd of hold {{ }}\n{TUNE.replace('against loads', 'against odd')}"
    for name in ("gains", "odd"):
        assert lines(said(tmp_path, text, name)) == [
            "error[D126]: sweep `odd` varies nothing", "= help: write `vary PATH = [...] UNIT;`",
        ]  # fmt: skip
    found = check(tmp_path / "d.ic", include_dirs=[], defines=[], select=["odd", "gains"])
    assert [each.code for each in found.diagnostics] == ["D126"]


@pytest.mark.parametrize(
    ("block", "why"),
    [
        ("vary integrator = [rk4, midpoint];", "it chooses what decides the program"),
        ("vary links.bar.mass = [1, 2] kg;  exclude when links.bar.mass > 1.5 kg;", "it leaves cases out"),
        ("vary links.bar.mass = [1, 2] kg;  repeat 3;", "it repeats cases"),
        ("vary links.bar.mass = [1, 2] kg;  seeds = independent;", "each of its cases has noise of its own"),
        ("sample random(until_shown, at_most = 50) { links.bar.mass = uniform(1, 2) kg; }",
         "it runs cases until something is shown"),
    ],
)  # fmt: skip
def test_a_sweep_that_nothing_is_tuned_against(tmp_path: Path, block: str, why: str) -> None:
    text = f"sweep odd of hold {{ {block} }}\n{TUNE.replace('against loads', 'against odd')}"
    assert lines(said(tmp_path, text, "gains"))[:2] == [
        f"error[D364]: nothing is tuned against sweep `odd`: {why}",
        "= help: a tuning is held against a list, a product or a sample of numbers: write such a sweep for it",
    ]


def test_a_sum_of_sweeps_has_no_search(tmp_path: Path) -> None:
    found = lines(said(tmp_path, f"{SEARCH}\nsweep both = loads + most;", "both"))
    assert found[:2] == [
        "error[D120]: `most` is a search, and a sweep is made of runs and sweeps",
        "= help: ask for both: `met run DECK NAME most`",
    ]


def test_all_that_is_chosen_may_not_be_set(tmp_path: Path) -> None:
    found = lines(said(tmp_path, SEARCH, settings=["drive.kp=0.015 V*s/rad"]))
    assert found[:2] == [
        "error[D361]: all that `most` chooses is set, so nothing is left to choose",
        "= help: leave one of them out of `--set`",
    ]


def test_mistakes_of_a_block_are_told_together(tmp_path: Path) -> None:
    text = SEARCH.replace("at_most = 100", "at_most = 1.5").replace("0.02)", "0.005)")
    assert [line.split(":")[0] for line in lines(said(tmp_path, text)) if line.startswith("error")] == [
        "error[D361]", "error[D363]",
    ]  # fmt: skip


def test_a_tuning_goes_by_gradients_unless_it_says_otherwise() -> None:
    for more, wanted in (("", True), ("gradients = on;", True), ("gradients = off;", False)):
        search = ic.compile(text=DECK + TUNE.replace("margin = 10 %;", more), select=["gains"]).experiments[0].search
        assert search is not None and search.gradients is wanted


@pytest.mark.slow
@pytest.mark.parametrize(
    ("written", "wanted", "explained"),
    [
        ("", (0.3, False), ""),
        ("least_margin = 0.3;", (0.3, True), "  candidates keep a disk margin of 0.3\n"),
        ("least_margin = 0.5;", (0.5, True), "  candidates keep a disk margin of 0.5\n"),
        ("least_margin = 0;", (0.0, False), "  its stability is not judged\n"),
    ],
)
def test_a_least_margin_steers_where_it_is_written_and_goes_into_the_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], written: str, wanted: tuple[float, bool], explained: str
) -> None:
    [experiment] = plan(tmp_path, TUNE.replace("margin = 10 %;", written), "gains").experiments
    search = experiment.search
    assert search is not None and (search.least_margin, search.steers) == wanted
    plan_file.write(ic.compile(tmp_path / "d.ic", select=["gains"]), tmp_path / "p.json")
    assert plan_file.read(tmp_path / "p.json").experiments[0].search == search
    assert main(["plan", str(tmp_path / "d.ic"), "gains"]) == 0
    assert f"to the limits of last < 5 rad\n{explained}" in capsys.readouterr().out
    assert main(["fmt", str(tmp_path / "d.ic")]) == 0
    assert main(["fmt", str(tmp_path / "d.ic"), "--check"]) == 0
    assert written in (tmp_path / "d.ic").read_text(encoding="utf-8")


def test_python_compiles_them(tmp_path: Path) -> None:
    (tmp_path / "d.ic").write_text(DECK + SEARCH, encoding="utf-8")
    assert ic.compile(tmp_path / "d.ic", select=["most"]).experiments[0].search is not None
    (tmp_path / "d.ic").write_text(DECK + SEARCH.replace("maximise last;", ""), encoding="utf-8")
    with pytest.raises(Problem):
        ic.compile(tmp_path / "d.ic", select=["most"])
