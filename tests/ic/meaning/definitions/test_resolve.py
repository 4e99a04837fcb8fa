"""Definitions and their bases: `like`, overriding, adding, appending, removing; the places of what was overridden."""

from __future__ import annotations

from pathlib import Path

from tests.ic.small_decks import ARM, RUN, SERVO, check, codes, experiment, messages

METRIC = (
    "run base like hold { metric top = max { of = hinge.qd; } metric end = final { of = hinge.q; }"
    " require top < 9 rad/s; }\n"
)


def derived(body: str) -> tuple[str, ...]:
    return (ARM, SERVO, RUN, METRIC, f"run it like base {{ {body} }}\n")


def test_like_takes_over_what_is_not_written(tmp_path: Path) -> None:
    run = experiment(tmp_path, *derived("duration = 2 s;"), select=["it"])
    assert run.structure.schedule.duration == 2.0
    assert [metric.name for metric in run.structure.metrics] == ["top", "end"]


def test_a_block_is_merged_key_by_key(tmp_path: Path) -> None:
    run = experiment(tmp_path, *derived("rates { record = 50 Hz; }"), select=["it"])
    schedule = run.structure.schedule
    assert (schedule.base_hz, schedule.dynamics, schedule.record) == (1000.0, 1, 20)


def test_a_list_is_replaced_and_plus_equals_appends(tmp_path: Path) -> None:
    replaced = experiment(tmp_path, *derived("record = [qd];"), select=["it"])
    assert [each.name for each in replaced.structure.record] == ["qd"]
    appended = experiment(tmp_path, *derived("record += [qd]; record += [tau];"), select=["it"])
    assert [each.name for each in appended.structure.record] == ["q", "qd", "tau"]


def test_a_block_without_its_kind_changes_what_is_there(tmp_path: Path) -> None:
    before = "run first like hold { metric done = settling_time { of = hinge.qd; target = 1 rad/s; band = 5 %; } }\n"
    run = experiment(tmp_path, ARM, SERVO, RUN, before, "run it like first { done { band = 1 %; } }", select=["it"])
    assert run.parameters["metrics.done.band"].value == 0.01
    assert run.parameters["metrics.done.target"].value == 1.0
    (overridden,) = run.parameters["metrics.done.band"].origin.overrides
    assert overridden.line == 18


def test_a_block_with_its_kind_adds_and_must_be_new(tmp_path: Path) -> None:
    run = experiment(tmp_path, *derived("metric low = min { of = hinge.q; }"), select=["it"])
    assert [metric.name for metric in run.structure.metrics] == ["top", "end", "low"]
    assert codes(tmp_path, *derived("metric top = min { of = hinge.q; }"), select=["it"]) == ["D053"]


def test_a_block_without_its_kind_must_be_in_the_base(tmp_path: Path) -> None:
    compiled = check(tmp_path, *derived("tip { of = hinge.q; }"), select=["it"])
    assert [diagnostic.code for diagnostic in compiled.diagnostics] == ["D109"]
    assert "did you mean `top`?" in messages(compiled)


def test_remove_takes_a_metric_away_and_its_requirements_with_it(tmp_path: Path) -> None:
    run = experiment(tmp_path, *derived("remove top;"), select=["it"])
    assert [metric.name for metric in run.structure.metrics] == ["end"]
    assert run.requirements == ()
    assert "`require top < 9 rad/s` went with the metric `top`, which is removed" in run.notes


def test_what_was_removed_may_be_added_again(tmp_path: Path) -> None:
    run = experiment(tmp_path, *derived("remove top; metric top = min { of = hinge.qd; }"), select=["it"])
    assert [metric.model for metric in run.structure.metrics] == ["final", "min"]


def test_a_requirement_of_the_base_goes_with_its_metric_though_another_takes_the_name(tmp_path: Path) -> None:
    again = "remove top; metric top = min { of = hinge.qd; }"
    run = experiment(tmp_path, *derived(again), select=["it"])
    assert run.requirements == ()
    assert "`require top < 9 rad/s` went with the metric `top`, which is removed" in run.notes
    run = experiment(tmp_path, *derived(f"{again} require top > 1 rad/s;"), select=["it"])
    assert [requirement.text for requirement in run.requirements] == ["top > 1 rad/s"]
    third = "run third like it { duration = 2 s; }"
    run = experiment(tmp_path, *derived(f"{again} require top > 1 rad/s;"), third, select=["third"])
    assert [requirement.text for requirement in run.requirements] == ["top > 1 rad/s"]


def test_a_requirement_after_its_metric_was_removed_is_an_error(tmp_path: Path) -> None:
    assert codes(tmp_path, *derived("remove top; require top > 1 rad/s;"), select=["it"]) == ["D132"]


def test_nothing_to_remove_is_told(tmp_path: Path) -> None:
    assert codes(tmp_path, *derived("remove topp;"), select=["it"]) == ["D058"]


def test_each_value_keeps_the_places_it_overrode_latest_first(tmp_path: Path) -> None:
    more = "servo second like drive { kp = 2 V*s/rad; }\nservo third like second { kp = 3 V*s/rad; }\n"
    run = "run it like hold { servos { hinge = third { kp = 4 V*s/rad; }; } }\n"
    parameter = experiment(tmp_path, ARM, SERVO, RUN, more, run, select=["it"]).parameters["hinge.servo.kp"]
    assert parameter.value == 4.0
    assert [place.line for place in parameter.origin.overrides] == [19, 18, 7]


def test_definitions_are_referred_to_not_copied(tmp_path: Path) -> None:
    """A base that stands below its user, and a servo that is defined after the run."""
    run = experiment(tmp_path, "run it like hold { duration = 3 s; }\n", RUN, SERVO, ARM, select=["it"])
    assert run.structure.schedule.duration == 3.0


def test_a_part_of_a_use_can_be_changed_in_a_run_like_it(tmp_path: Path) -> None:
    first = "run first like hold { servos { hinge = drive { kp = 2 V*s/rad; }; } }\n"
    run = experiment(
        tmp_path, ARM, SERVO, RUN, first, "run it like first { servos { hinge { ki = 7 V/rad; } } }", select=["it"]
    )
    assert run.parameters["hinge.servo.kp"].value == 2.0
    assert run.parameters["hinge.servo.ki"].value == 7.0


def test_an_arm_like_another_changes_adds_and_removes(tmp_path: Path) -> None:
    arm = """arm longer like swing {
        bar { mass = 3 kg; }
        link tip { mass = 1 kg; shape = sphere(radius = 5 cm); }
        joint wrist fixed { parent = bar; child = tip; at = [1, 0, 0] m; }
    }\n"""
    run = experiment(tmp_path, ARM, SERVO, RUN, arm, "run it like hold { arm = longer; }", select=["it"])
    assert [link.name for link in run.structure.links] == ["bar", "tip"]
    assert run.parameters["links.bar.mass"].value == 3.0
    assert run.parameters["links.bar.inertia.zz"].value == 3.0 / 12.0


def test_like_in_a_circle_is_told(tmp_path: Path) -> None:
    loop = "servo a like b { }\nservo b like a { }\n"
    assert codes(tmp_path, ARM, SERVO, RUN, loop) == ["D043"]


def test_a_definition_written_twice_is_told_with_both_places(tmp_path: Path) -> None:
    compiled = check(tmp_path, ARM, SERVO, SERVO, RUN)
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.code == "D040"
    assert diagnostic.at is not None
    assert (diagnostic.at.place.line, diagnostic.also[0].place.line) == (11, 5)


def test_a_key_written_twice_in_one_block_is_told(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SERVO, RUN.replace("duration", "duration = 2 s; duration")) == ["D040"]


def test_keywords_are_soft(tmp_path: Path) -> None:
    """Joints, links, metrics and definitions may bear the language's own words."""
    deck = """arm arm {
        link link { mass = 1 kg; shape = sphere(radius = 1 cm); }
        link joint { mass = 1 kg; shape = sphere(radius = 1 cm); }
        joint at revolute { parent = base; child = link; axis = z; }
        joint sample prismatic { parent = link; child = joint; axis = x; }
    }
    run run { arm = arm; rates { dynamics = 1 kHz; } duration = 1 s; record = [at.q, sample.qd];
              metric like = max { of = sample.q; } require like < 1 m; }
    sweep sweep of run { vary links.link.mass = [1, 2] kg; vary initial.at.q = [0, 1] rad; }\n"""
    swept = experiment(tmp_path, deck, select=["sweep"])
    assert swept.cases.count == 4
