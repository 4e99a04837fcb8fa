"""Of two decks: which lines differ, what was written otherwise, and after that what follows from it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

import ic
from batch.differences import words
from batch.differences.decks import MOST_COMPARED, decks
from batch.differences.provenance import provenance_changes
from batch.differences.text import Shortening, _changed, _shortened

ARM = """\
let fore_l  = 3 m;
let upper_l = 2 m;
#define ROD(NAME, MASS, LENGTH) link NAME { mass = MASS; shape = rod(length = LENGTH, along = x); }
arm crane {
    ROD(upper, 40 kg, upper_l)
    ROD(fore, 20 kg, fore_l)
    link tip { mass = 2 kg; shape = sphere(radius = 50 mm); }
    joint shoulder revolute { parent = base;  child = upper; axis = z; }
    joint elbow    revolute { parent = upper; child = fore;  axis = z; at = [upper_l, 0 m, 0 m]; }
    joint wrist    fixed    { parent = fore;  child = tip;   at = [fore_l, 0 m, 0 m]; }
}
"""
DECK = """\
#include <servos/rigid_gearbox.ic>
#include "arm.ic"
let slow = 0.03 rad/s;
servo gearbox like rigid_gearbox { command = rate(slow); }
run nominal {
    arm      = crane;
    servos   { shoulder = gearbox;  elbow = gearbox; }
    rates    { dynamics = 100 Hz;  servos = 100 Hz;  record = 25 Hz; }
    duration = 5 s;
    record   = [q, qd];
    metric settle = settling_time { of = shoulder.qd;  target = slow;  band = 2 %; }
}
sweep gains of nominal { vary gearbox.kp = linspace(0.010, 0.040, 4) V*s/rad; }
"""


def made(
    folder: Path, *, deck: str = DECK, arm: str = ARM, select: str = "nominal", **options: object
) -> SimpleNamespace:
    """What an archive of this deck has to say of how it was made."""
    (folder / "deck.ic").write_text(deck)
    (folder / "arm.ic").write_text(arm)
    plan = ic.compile(folder / "deck.ic", select=[select], **options)  # type: ignore[arg-type]
    texts = {each.name: each.text for each in plan.sources}
    [experiment] = plan.experiments
    group = SimpleNamespace(name=experiment.name, attributes={}, variables={}, single=False)
    return SimpleNamespace(plan=plan, group=group, provenance={}, sources=lambda: texts)


def said(folder: Path, *changes: tuple[str, str], select: str = "nominal", now: str | None = None) -> list[str]:
    """The lines that tell what another deck changes, with its texts replaced, but those of the decks themselves."""
    deck, arm = DECK, ARM
    for old, new in changes:
        assert old in deck + arm
        deck, arm = deck.replace(old, new), arm.replace(old, new)
    return told(made(folder, select=select), made(folder, deck=deck, arm=arm, select=now or select))


def told(a: SimpleNamespace, b: SimpleNamespace) -> list[str]:
    found = provenance_changes(a, b, [(a.group, b.group)], [a.plan, b.plan])  # type: ignore[arg-type]
    lines = words.provenance_lines(SimpleNamespace(changed=found))  # type: ignore[arg-type]
    return [f"{kind}: {line}" for kind, each in lines for line in each if kind != "deck"]


PAGE = (Path(__file__).parents[3] / "docs" / "diff.md").read_text(encoding="utf-8")


def test_lines_are_cut_where_they_begin_to_differ(here: Path) -> None:
    pad = "pad " * 60
    old, new = f"{pad}1 m;{' end' * 60}", f"{pad}2 m;{' end' * 60}"
    found = decks({"d.ic": f"{old}\n"}, {"d.ic": f"{new}\n"})
    lines = ["said", *(f"  {line}" for line in found.files[0].lines)]
    gone, now = _shortened(lines)[-2:]
    assert gone.startswith("  -... pad pad") and now.startswith("  +... pad pad")
    assert "1 m; end" in gone and "2 m; end" in now and max(len(gone), len(now)) < 140
    assert gone.replace("1 m;", "2 m;")[3:] == now[3:]
    # far apart lines, lines that are alike to a point, and changes in words
    assert _shortened(["  -x", "  +" + "y" * 200])[1] == "  +" + "y" * 120 + " ..."
    long = f"let reach: {pad}1 -> {pad}2"
    [short] = _shortened([long])
    assert short.startswith("let reach: ... ") and short.endswith("pad 2") and "pad 1 -> ..." in short
    assert _shortened(["z" * 200]) == ["z" * 120 + " ..."]


def test_an_archive_of_single_precision_is_named(here: Path) -> None:
    a, b = made(Path()), made(Path())
    b.group.single = True
    assert told(a, b) == ["kept: histories of `nominal`: double precision, now single precision (`--float32`)"]


def test_a_let_is_told_before_the_parameters_that_follow_from_it(here: Path) -> None:
    a, b = made(Path(), arm=ARM), made(Path(), arm=ARM.replace("3 m;", "3.4 m;"))
    found = provenance_changes(a, b, [(a.group, b.group)], [a.plan, b.plan])  # type: ignore[arg-type]
    lines = list(_changed(SimpleNamespace(changed=found), Shortening()))  # type: ignore[arg-type]
    assert "\n".join(lines[1:]) in PAGE
    assert lines == [
        "",
        "  deck       arm.ic: 1 line new, 1 gone",
        "               @@ -1,2 +1,2 @@",
        "               -let fore_l  = 3 m;",
        "               +let fore_l  = 3.4 m;",
        "                let upper_l = 2 m;",
        "  changed    let fore_l: 3 m -> 3.4 m (arm.ic:1)",
        "  follows    links.fore.com.x: 1.5 m -> 1.7 m (arm.ic:3)",
        "  follows    links.fore.inertia.yy: 15 kg*m^2 -> 19.2667 kg*m^2 (arm.ic:3)",
        "  follows    links.fore.inertia.zz: 15 kg*m^2 -> 19.2667 kg*m^2 (arm.ic:3)",
        "  follows    wrist.at.x: 3 m -> 3.4 m (arm.ic:10)",
    ]


CHANGES: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "a gain": (
        [("rate(slow);", "rate(slow); kp = 0.03 V*s/rad;")],
        [
            "changed: elbow.servo.kp: 0.02 V*s/rad -> 0.03 V*s/rad (deck.ic:4)",
            "changed: shoulder.servo.kp: 0.02 V*s/rad -> 0.03 V*s/rad (deck.ic:4)",
        ],
    ),
    "a macro": (
        [("mass = MASS;", "mass = 2 * MASS;")],
        [
            "changed: #define ROD() is another (arm.ic:3)",
            "changed: links.fore.mass: 20 kg -> 40 kg (arm.ic:3)",
            "changed: links.upper.mass: 40 kg -> 80 kg (arm.ic:3)",
            "follows: links.fore.inertia.yy: 15 kg*m^2 -> 30 kg*m^2 (arm.ic:3)",
            "follows: links.fore.inertia.zz: 15 kg*m^2 -> 30 kg*m^2 (arm.ic:3)",
            "follows: links.upper.inertia.yy: 13.3333 kg*m^2 -> 26.6667 kg*m^2 (arm.ic:3)",
            "follows: links.upper.inertia.zz: 13.3333 kg*m^2 -> 26.6667 kg*m^2 (arm.ic:3)",
        ],
    ),
    "a joint": (
        [("wrist    fixed    { parent = fore;", "wrist revolute { axis = z;  parent = fore;")],
        [
            "changed: joint wrist: kind fixed -> revolute",
            "follows: initial.wrist.q is new: 0 rad",
            "follows: initial.wrist.qd is new: 0 rad/s",
            "follows: wrist.axis is new: [0, 0, 1] (arm.ic:10)",
        ],
    ),
    "a metric": (
        [("    metric settle", "    metric top = max { of = elbow.q; }\n    metric settle")],
        [
            "changed: metric top is new",
        ],
    ),
    "a run's name": ([("nominal", "slewing")], []),
    "the seed": ([("    duration", "    seed = 7;\n    duration")], ["changed: seed: 0 -> 7"]),
    "rates and duration": (
        [("dynamics = 100 Hz;  servos = 100 Hz;", "dynamics = 200 Hz;  servos = 50 Hz;"), ("= 5 s", "= 6 s")],
        [
            "changed: duration: 5 s -> 6 s",
            "changed: rates.dynamics: 100 Hz -> 200 Hz",
            "changed: servo of shoulder: rate 100 Hz -> 50 Hz",
            "changed: servo of elbow: rate 100 Hz -> 50 Hz",
        ],
    ),
    "a command": (
        [("rate(slow)", "rate(step(to = slow))")],
        [
            "changed: servo of shoulder: command rate(constant) -> rate(step)",
            "changed: servo of elbow: command rate(constant) -> rate(step)",
            "follows: elbow.servo.command.at is new: 0 s",
            "follows: elbow.servo.command.start is new: 0 rad/s",
            "follows: elbow.servo.command.to is new: 0.03 rad/s (deck.ic:4)",
            "follows: shoulder.servo.command.at is new: 0 s",
            "follows: shoulder.servo.command.start is new: 0 rad/s",
            "follows: shoulder.servo.command.to is new: 0.03 rad/s (deck.ic:4)",
            "follows: elbow.servo.command.value is gone: 0.03 rad/s (deck.ic:4)",
            "follows: shoulder.servo.command.value is gone: 0.03 rad/s (deck.ic:4)",
        ],
    ),
    "an expression": (
        [("    metric settle", "    metric top = max { of = abs(elbow.q) + 0.1 rad; }\n    metric settle")],
        ["changed: metric top is new", "changed: expression abs(elbow.q) + 0.1 rad is new"],
    ),
    "a comment": ([("let slow", "// as slow as it gets\nlet slow")], []),
    "a let that nothing needs": ([("let slow", "let unused = 3 m;\nlet slow")], []),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", CHANGES)
def test_what_was_written_is_told_before_what_follows(here: Path, what: str) -> None:
    changes, expected = CHANGES[what]
    assert said(Path(), *changes, now="slewing" if what == "a run's name" else None) == expected


def test_of_a_base_that_moves_now_all_else_follows(here: Path) -> None:
    first, *rest = said(Path(), ("    servos ", "    base = prescribed { z = 1 m; };\n    servos "))
    assert first == "changed: base: fixed -> prescribed"
    assert "follows: base.z.value is new: 1 m (deck.ic:7)" in rest
    assert all(line.startswith("follows: ") for line in rest), rest


def test_an_axis_with_more_values_is_one_change_beside_their_number(here: Path) -> None:
    more = ("vary", "vary gearbox.ki = [0.1, 0.2] V/rad;  vary")
    assert said(Path(), ("0.040, 4", "0.050, 5"), select="gains") == [
        "changed: 4 cases -> 5 cases",
        "changed: gearbox.kp: 4 values from 0.01 to 0.04 V*s/rad -> 5 values from 0.01 to 0.05 V*s/rad",
    ]
    assert said(Path(), more, select="gains") == [
        "changed: 4 cases -> 8 cases",
        "changed: gearbox.ki is varied now: [0.1, 0.2] V/rad",
        "follows: elbow.servo.ki: 0.125 V/rad -> varied (deck.ic:13)",
        "follows: shoulder.servo.ki: 0.125 V/rad -> varied (deck.ic:13)",
    ]


def test_what_follows_is_told_of_parameters_that_vary_with_the_case_too(here: Path) -> None:
    axis = ("vary gearbox.kp = linspace(0.010, 0.040, 4) V*s/rad;", "vary links.fore.mass = [10, 20, 40] kg;")
    varied = DECK.replace(*axis)
    a, b = (
        made(Path(), deck=varied, select="gains"),
        made(Path(), deck=varied, arm=ARM.replace("fore_l  = 3 m", "fore_l  = 6 m"), select="gains"),
    )
    assert told(a, b) == [
        "changed: let fore_l: 3 m -> 6 m (arm.ic:1)",
        "follows: links.fore.com.x: 1.5 m -> 3 m (arm.ic:3)",
        "follows: links.fore.inertia.yy: 7.5 to 30 kg*m^2 -> 30 to 120 kg*m^2, varied (arm.ic:3)",
        "follows: links.fore.inertia.zz: 7.5 to 30 kg*m^2 -> 30 to 120 kg*m^2, varied (arm.ic:3)",
        "follows: wrist.at.x: 3 m -> 6 m (arm.ic:10)",
    ]
    more = DECK.replace(axis[0], "vary links.fore.mass = [10, 20, 30, 40] kg;")
    assert told(a, made(Path(), deck=more, select="gains")) == [
        "changed: 3 cases -> 4 cases",
        "changed: links.fore.mass: [10, 20, 40] kg -> 4 values from 10 to 40 kg",
    ]  # other values of what is varied change no formula


def test_a_parameter_that_one_axis_fewer_enters_is_told(here: Path) -> None:
    axis = "vary gearbox.kp = linspace(0.010, 0.040, 4) V*s/rad;"
    mass, length = "vary links.fore.mass = [10, 20] kg;", "vary fore_l = [3, 6] m;"
    both, one = (DECK.replace(axis, axes) for axes in (mass + length, mass))
    assert told(made(Path(), deck=both, select="gains"), made(Path(), deck=one, select="gains")) == [
        "changed: 4 cases -> 2 cases",
        "changed: fore_l is not varied any more",
        "follows: links.fore.com.x: varied -> 1.5 m (arm.ic:3)",
        "follows: links.fore.inertia.yy: 7.5 to 60 kg*m^2 -> 7.5 to 15 kg*m^2, varied (arm.ic:3)",
        "follows: links.fore.inertia.zz: 7.5 to 60 kg*m^2 -> 7.5 to 15 kg*m^2, varied (arm.ic:3)",
        "follows: wrist.at.x: varied -> 3 m (arm.ic:10)",
    ]


def test_what_is_set_on_the_command_line_was_written_there(here: Path) -> None:
    a, b = made(Path()), made(Path(), set=["gearbox.kp=0.03 V*s/rad"])
    assert [line.partition(" (")[0] for line in told(a, b)] == [
        "changed: elbow.servo.kp: 0.02 V*s/rad -> 0.03 V*s/rad",
        "changed: shoulder.servo.kp: 0.02 V*s/rad -> 0.03 V*s/rad",
    ]


def test_more_than_a_screen_is_cut_with_the_command_that_shows_it() -> None:
    lines = tuple(f"p{i}: 1 -> 2" for i in range(9))
    found = SimpleNamespace(
        changed=SimpleNamespace(
            versions=(),
            decks=(),
            meaning=("let x: 1 -> 2",),
            follows=lines,
            defaults=(),
            structure=(),
            code=(),
            results=(),
            kept=(),
        )
    )
    short = list(_changed(found, Shortening(remedy="`met diff a.h5 b.h5 --all`")))  # type: ignore[arg-type]
    assert short[-1] == "  follows    and 3 more: `met diff a.h5 b.h5 --all`" and len(short) == 9
    assert len(list(_changed(found, Shortening(every=True)))) == 11  # type: ignore[arg-type]


# Files


def test_a_file_under_another_name_or_in_another_folder_is_the_same_file() -> None:
    text = "one\ntwo\nthree\nfour\n"
    found = decks(
        {"/a/deck.ic": "x\n", "/a/arm.ic": text, "/a/gone.ic": "-"},
        {"/b/deck.ic": "y\n", "/b/crane.ic": text.replace("two", "2"), "/b/more.ic": "+\n+\n"},
    )
    assert [each.said for each in found.files] == [
        "/a/deck.ic, now /b/deck.ic: 1 line new, 1 gone",
        "/a/arm.ic, now /b/crane.ic: 1 line new, 1 gone",
        "/a/gone.ic is gone: 1 line",
        "/b/more.ic is new: 2 lines",
    ]
    assert found.files[1].lines == ("@@ -1,3 +1,3 @@", " one", "-two", "+2", " three")
    same = decks({"/a/deck.ic": text}, {"/b/deck.ic": text})
    assert not same.files


def test_another_deck_is_counted_alone() -> None:
    [found] = decks({"one.ic": "a\nb\nc\n"}, {"two.ic": "d\ne\n"}).files
    assert (found.said, found.lines) == ("one.ic, now two.ic: another deck, 2 lines new, 3 gone", ())


@pytest.mark.parametrize(
    ("before", "now", "lines"),
    [
        ("", "a\n", ["@@ -1,0 +1,1 @@", "+a"]),
        ("a\n", "a\na\n", ["@@ -1,1 +1,2 @@", " a", "+a"]),
        ("a\nb\nc\nd\n", "a\nd\n", ["@@ -1,4 +1,2 @@", " a", "-b", "-c", " d"]),
        ("a\n", "a", []),
    ],
)
def test_the_lines_that_differ(before: str, now: str, lines: list[str]) -> None:
    [found] = decks({"d.ic": before}, {"d.ic": now}).files
    assert list(found.lines) == lines


def test_a_difference_that_is_too_long_is_counted_alone() -> None:
    before = "".join(f"{i}\n" for i in range(2 * MOST_COMPARED))
    [found] = decks({"t.csv": before}, {"t.csv": before.replace("1", "2")}).files
    assert found.said.startswith("t.csv: ") and found.lines == ()
    [found] = decks({"t.csv": before}, {"t.csv": before.replace("\n4000\n", "\n4e3\n")}).files
    assert found.lines == ("@@ -4000,3 +4000,3 @@", " 3999", "-4000", "+4e3", " 4001")


def test_lets_and_macros_are_told_by_their_text_alone() -> None:
    before = "let a = 1 m;\n#define N 3\nlet b = /* two */ 2  m; // b\n#define F(X) X\nlet twice = 1;\nlet twice = 2;\n"
    after = "#define N 4\nlet a =\n  3 m;\nlet b = 2 m;\n#define F(X) (X)\nlet c = 5;\nlet twice = 3;\nlet twice = 2;\n"
    assert decks({"d.ic": before}, {"d.ic": after}).names == (
        "let a: 1 m -> 3 m (d.ic:2)",
        "#define N: 3 -> 4 (d.ic:1)",
        "#define F() is another (d.ic:5)",
        "let c is new: 5 (d.ic:6)",
    )
    assert decks({"d.ic": before}, {"d.ic": ""}).names == (
        "let a is gone: 1 m (d.ic:1)",
        "#define N is gone: 3 (d.ic:2)",
        "let b is gone: 2 m (d.ic:3)",
        "#define F() is gone (d.ic:4)",
    )


@pytest.mark.parametrize("text", ["let", "let a", "let a =", "#define", "#", "let = 3;", '"', "/*", "let a = let b"])
def test_a_deck_that_is_none_is_no_traceback(text: str) -> None:
    decks({"d.ic": text}, {"d.ic": "let a = 2;"})
    decks({"d.ic": "let a = 2;"}, {"d.ic": text})


def test_what_cannot_be_seen_is_made_visible() -> None:
    found = decks({"d.ic": "a\n"}, {"d.ic": "\x1b[31mred\n"})
    lines = words.provenance_lines(
        SimpleNamespace(
            changed=SimpleNamespace(  # type: ignore[arg-type]
                versions=(),
                decks=found.files,
                meaning=(),
                follows=(),
                defaults=(),
                structure=(),
                code=(),
                results=(),
                kept=(),
            )
        )
    )
    assert lines[0][1][-1] == "  +\\x1b[31mred"
