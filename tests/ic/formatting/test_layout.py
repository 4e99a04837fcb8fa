"""What `met fmt` makes of a deck: indentation, blanks, alignment, and what it leaves alone."""

from __future__ import annotations

import pytest

from ic.formatting.formatter import formatted, prove
from met.diagnostic import Problem
from met.messages.render import render


def fmt(text: str, *strings: str) -> str:
    return formatted("a.ic", text, strings)


def told(text: str) -> str:
    with pytest.raises(Problem) as caught:
        fmt(text)
    return render(caught.value.diagnostics, caught.value.sources)


LAYOUTS = {
    "a line is indented by the brackets it stands in": (
        """\
run hold {
arm=bar;
    servos {
  shoulder = drive {
            command = rate(
    table(times = [0, 1] s,
          values = [0, 2] rad/s
    )
    );
  }
    }
}
""",
        """\
run hold {
    arm = bar;
    servos {
        shoulder = drive {
            command = rate(
                table(times = [0, 1] s,
                      values = [0, 2] rad/s
                )
            );
        }
    }
}
""",
    ),
    "brackets that open on one line indent once": (
        "a { b = f(g([\n1,\n2\n]));\n}\n",
        "a { b = f(g([\n    1,\n    2\n]));\n}\n",
    ),
    "a line that goes on with an entry is indented further": (
        "a {\nb =\nc\n+ d;\nexclude when x > 1 m\nand y < 2 m;\nROD(x, 1 kg)\nROD(y, 2 kg)\n}\n",
        "a {\n    b =\n        c\n        + d;\n    exclude when x > 1 m\n        and y < 2 m;\n"
        "    ROD(x, 1 kg)\n    ROD(y, 2 kg)\n}\n",
    ),
    "blank lines at most one in a block two outside and none at the edges": (
        "\n\na {\n\n\nb = 1;\n\n\n\nc = 2;\n\n}\n\n\n\nd { }\n\n\n",
        "a {\n    b = 1;\n\n    c = 2;\n}\n\n\nd { }\n",
    ),
    "a name that has become longer takes the others with it": (
        "mass    = 1 kg;\ninertia_of_it = [1, 1, 1] kg*m^2;\ncom     = [0, 0, 0] m;\n",
        "mass          = 1 kg;\ninertia_of_it = [1, 1, 1] kg*m^2;\ncom           = [0, 0, 0] m;\n",
    ),
    "what is not aligned has the blanks it needs": ("a  = 1;\n\nbc =    2;\n", "a = 1;\n\nbc = 2;\n"),
    "a long comment moves as a whole": (
        "a {\n  /* one\n     two\n\n   three */\n  b = 1;  \n}\n",
        "a {\n    /* one\n       two\n\n     three */\n    b = 1;\n}\n",
    ),
    "what stands between if and endif is laid out where its parts agree about brackets": (
        "#if A\nrun x {\n#else\nrun y {\n#endif\narm=b;\n#ifdef C\nd=e;\n#endif\n}\n",
        "#if A\nrun x {\n#else\nrun y {\n#endif\n    arm = b;\n#ifdef C\n    d = e;\n#endif\n}\n",
    ),
}
"""A text, and how it is laid out."""


@pytest.mark.parametrize(("text", "laid_out"), LAYOUTS.values(), ids=LAYOUTS)
def test_a_text_is_laid_out_so(text: str, laid_out: str) -> None:
    assert fmt(text) == laid_out


@pytest.mark.parametrize(("written", "laid"), [
    ("a=b", "a = b"),
    ("a+=[ q ,qd ]", "a += [q, qd]"),
    ("f ( x=1 , y=2 )", "f(x = 1, y = 2)"),
    ("a=3kg * m ^ 2", "a = 3 kg*m^2"),
    ("a = 2 N*m / (rad / s)*reach", "a = 2 N*m/(rad/s) * reach"),
    ("a = 15   1 / s", "a = 15 1/s"),
    ("a = [1,2]m", "a = [1, 2] m"),
    ("a = linspace(0,1,5)V * s / rad", "a = linspace(0, 1, 5) V*s/rad"),
    ("a = TEETH V*s/rad", "a = TEETH V*s/rad"),
    ("a=2%", "a = 2 %"),
    ("a=b*c", "a = b * c"),
    ("a=(1/3)*b", "a = (1/3) * b"),
    ("a = b ^ 2/c", "a = b^2 / c"),
    ("a = - 3 m", "a = -3 m"),
    ("a = b- 3 m", "a = b - 3 m"),
    ("a = [- b, + 2]", "a = [-b, +2]"),
    ("a=-(b+c)", "a = -(b + c)"),
    ("require a<-3 m", "require a < -3 m"),
    ("exclude when not(a<b)and-c>=d", "exclude when not (a < b) and -c >= d"),
    ("vary  h . kp=1..5 by 2", "vary h.kp = 1 .. 5 by 2"),
    ("a{b=c;d=e;}", "a { b = c;  d = e; }"),
    ("a {}", "a { }"),
    ("a { b { c = d; } e = f; }", "a { b { c = d; }  e = f; }"),
    ("a = f{ b = c; } ;", "a = f { b = c; };"),
    ("a = b;c = d ;   // why", "a = b;  c = d;   // why"),
    ("a = b;// why", "a = b;  // why"),
    ("f(/*n*/3,x)", "f(/*n*/3, x)"),
    ("a\t=\tb;", "a = b;"),
])  # fmt: skip
def test_blanks_between_tokens(written: str, laid: str) -> None:
    assert fmt(written) == laid + "\n"


def test_where_lines_are_counted_they_stay() -> None:
    text = "let a = 1;\n\n\n\nlet b = __LINE__;\n"
    assert fmt(text) == text


def test_what_the_author_aligned_stays_aligned_when_something_before_it_grows() -> None:
    assert fmt("mass   =1;\ninertia=2;\n") == "mass    = 1;\ninertia = 2;\n"
    assert fmt("a { x=1;  y = 2; }\nb { xx=1; y = 2; }\n") == "a { x = 1;   y = 2; }\nb { xx = 1;  y = 2; }\n"


def test_the_brace_of_a_block_is_aligned_like_a_sign() -> None:
    text = "run r {\n    rates       { base = 1 kHz; }\n    environment { gravity = g; }\n    duration    = 1 s;\n}\n"
    assert fmt(text.replace("    rates ", "  rates ")) == text


@pytest.mark.parametrize(("written", "laid"), [
    (  # stops of four: the signs are at column 28
        "run r {\n\trequire t_shoulder\t\t< 0.8 s;\n\trequire t_z\t\t\t\t< 1.1 s;\n}\n",
        "run r {\n    require t_shoulder      < 0.8 s;\n    require t_z             < 1.1 s;\n}\n",
    ),
    (  # of eight: at column 32
        "run r {\n\trequire t_shoulder\t< 0.8 s;\n\trequire t_z\t\t< 1.1 s;\n}\n",
        "run r {\n    require t_shoulder      < 0.8 s;\n    require t_z             < 1.1 s;\n}\n",
    ),
    (  # of two: at column 16
        "run r {\n\trequire over1\t< 2 %;\n\trequire t\t\t\t< 1.1 s;\n}\n",
        "run r {\n    require over1 < 2 %;\n    require t     < 1.1 s;\n}\n",
    ),
    (
        "a {\n\tlink upper\t{mass=6.5 kg;\tshape=x;}\n\tlink fore\t{mass=5.25 kg;\tshape=x;}\n}\n",
        "a {\n    link upper  { mass = 6.5 kg;   shape = x; }\n    link fore   { mass = 5.25 kg;  shape = x; }\n}\n",
    ),
    ("let a=1;\t// one\nlet inertia=2;\t// two\n", "let a = 1;        // one\nlet inertia = 2;  // two\n"),
    ("a = table(b = [0,1],\n\t  c = [1,2]\n);\n", "a = table(b = [0, 1],\n          c = [1, 2]\n);\n"),
], ids=["four", "eight", "two", "braces", "comments", "below"])  # fmt: skip
def test_tab_stops_are_where_most_columns_meet(written: str, laid: str) -> None:
    assert fmt(written) == laid


@pytest.mark.parametrize(
    ("written", "laid"),
    [
        (  # with stops of four, the last `<` is below the number above it
            "a {\n\trequire t_shoulder < 0.8 s;\n\trequire t_z\t\t< 1.1 s;\n\trequire over1\t  < 2 %;\n}\n",
            "a {\n    require t_shoulder < 0.8 s;\n    require t_z < 1.1 s;\n    require over1 < 2 %;\n}\n",
        ),
        (  # and here `mass` is below the brace
            "a {\n\tlink upper   {mass=6.5 kg;}\n\tlink fore\t{mass=5.2 kg;}\n}\n",
            "a {\n    link upper { mass = 6.5 kg; }\n    link fore { mass = 5.2 kg; }\n}\n",
        ),
    ],
)
def test_tabs_with_which_nothing_meets_are_blanks(written: str, laid: str) -> None:
    assert fmt(written) == laid


@pytest.mark.parametrize(("written", "laid"), [
    (  # two `=`, and the ends of two names, with one blank and two before them
        "servo wrist like motor { ratio = 30;  kt = 0.05; }\nservo perfect { model = ideal; bandwidth = 60; }\n",
        "servo wrist like motor { ratio = 30;  kt = 0.05; }\nservo perfect { model = ideal;  bandwidth = 60; }\n",
    ),
    (  # two entries of other names, with a line between
        "servos { one = gear;  two = gear; }\nq { x = 0; }\nrates { base = 2 kHz; servos = 1 kHz; }\n",
        "servos { one = gear;  two = gear; }\nq { x = 0; }\nrates { base = 2 kHz;  servos = 1 kHz; }\n",
    ),
    ("a =  b;\nc = f(g);\n", "a = b;\nc = f(g);\n"),  # a name that is set apart, and a bracket
    ("ab = f(g,   h);\nc = [d, e, i];\n", "ab = f(g, h);\nc = [d, e, i];\n"),  # and a comma
    ("a = b   + c;\na = [b, c];\n", "a = b + c;\na = [b, c];\n"),  # a sign, and a name
    ("a { b = [c, d]; }\ne = [f,     g];\n", "a { b = [c, d]; }\ne = [f, g];\n"),  # in one bracket, and in two
    ("f( x = 1);\nf(g(y = 2));\n", "f(x = 1);\nf(g(y = 2));\n"),  # one blank sets nothing apart
])  # fmt: skip
def test_what_meets_by_chance_is_not_aligned(written: str, laid: str) -> None:
    assert fmt(written) == laid


def test_what_two_blanks_set_apart_is_aligned_with_its_like() -> None:
    text = "servos  { shoulder = gear;  elbow = gear; }\ninitial { q = 0 rad;        qd = 0 rad/s; }\n"
    assert fmt(text) == text
    assert fmt("servos  { shoulder=gear;   elbow=gear; }\ninitial { q = 0 rad;       qd=0 rad/s; }\n") == text


def test_numbers_keep_their_ends_and_their_points_below_each_other() -> None:
    text = "a = [  0, -45, 10.25] deg;\nb = [ 90,   5,  1.5] deg;\nc = [-90,  45,  0] deg;\n"
    assert fmt(text) == text


def test_a_blank_stands_where_a_list_of_the_same_name_has_a_sign() -> None:
    text = "joint one { parent = base;  rpy = [-90, 0] deg; }\njoint two { rpy = [ 90, 0] deg; }\n"
    assert fmt(text.replace(" = ", "=")) == text
    assert fmt(text.replace("[-90", "[90")) == text.replace("[-90", "[90").replace("[ 90", "[90")


def test_comments_at_the_ends_of_lines_stay_aligned() -> None:
    assert fmt("let a=1;    // one\n            // and more of it\nlet width=2;     // two\n") == (
        "let a = 1;    // one\n              // and more of it\nlet width = 2;     // two\n"
    )
    assert fmt("let a=12;   // one\nlet width=2;// two\nlet bb=3;   // three\n") == (
        "let a = 12;     // one\nlet width = 2;  // two\nlet bb = 3;     // three\n"
    )
    text = "let a = 1;              // far out\nlet bb = 2;\nlet ccc = 3;            // and below\n"
    assert fmt(text.replace("a = 1; ", "a=1;   ")) == text


def test_comments_and_preprocessor_lines_keep_what_is_in_them() -> None:
    text = (
        "#include   <two_link.ic>\t// a\n#  define  ROD( N,M )  link N{mass=M;}  \\\n\t  shape=x\n"
        "//\ttabs  and   blanks\n#if  A==1\n#endif\n"
    )
    assert fmt(text.replace("\n", "  \n")) == text


def test_what_if_leaves_out_may_be_anything_and_stays() -> None:
    text = "#if 0\n  don't   touch ( this\n\n\n\n#endif\nlet a = 1;\n#ifdef B\n  run x {\n#endif\n"
    assert fmt(text) == text


def test_a_use_of_a_macro_that_makes_a_string_of_its_argument_stays() -> None:
    text = "a = SAID(b  +c,\n d);\ne=f;\n"
    assert fmt(text, "SAID") == "a = SAID(b  +c,\n d);\ne = f;\n"


def test_a_line_that_a_backslash_or_a_comment_joins_stays() -> None:
    text = "a=b \\\n  +c;\nd=e; /* f\n  g */ h=i;\n"
    assert fmt(text) == text


def test_a_line_ends_with_a_newline_and_the_last_one_too() -> None:
    assert fmt("a = b;  \n  ") == "a = b;\n"
    assert fmt("") == fmt(" \n\t\n") == ""


@pytest.mark.parametrize(("text", "said"), [
    ("a {\n    b = [1, 2;\n}\n", """\
error[D022]: expected `]`, found `}`
 --> a.ic:3:1
  |
3 | }
  | ^
 ::: a.ic:2:9  to close this `[`
  = help: a file is laid out by itself: a bracket of a macro's body or of another file is not seen

1 error
"""),
    ("a { b = 1;\n", """\
error[D022]: this `{` is not closed
 --> a.ic:1:3
  |
1 | a { b = 1;
  |   ^
  = help: write the `}` where it ends
  = help: a file is laid out by itself: a bracket of a macro's body or of another file is not seen

1 error
"""),
    ("a = 1; }\n", """\
error[D022]: this `}` closes nothing
 --> a.ic:1:8
  |
1 | a = 1; }
  |        ^
  = help: leave it out, or open it where it begins
  = help: a file is laid out by itself: a bracket of a macro's body or of another file is not seen

1 error
"""),
    ("#if A\n/* on and on\n#endif\n", """\
error[D003]: this comment is not closed
 --> a.ic:2:1
  |
2 | /* on and on
  | ^^
  = help: its `*/` is missing

1 error
"""),
    ("#endif\n", """\
error[D007]: `#endif` without an `#if`
 --> a.ic:1:2
  |
1 | #endif
  |  ^^^^^
  = help: leave it out, or write the `#if` that it belongs to

1 error
"""),
    ("a = 1;\n#ifdef B\n", """\
error[D008]: `#ifdef` is not closed
 --> a.ic:2:2
  |
2 | #ifdef B
  |  ^^^^^
  = help: `a.ic` ends without its `#endif`

1 error
"""),
    ('a = "b;\n', """\
error[D003]: this string is not closed
 --> a.ic:1:5
  |
1 | a = "b;
  |     ^^^
  = help: a string ends with `"` on the line it began on

1 error
"""),
])  # fmt: skip
def test_a_broken_deck_is_told_where_it_is_broken(text: str, said: str) -> None:
    assert told(text) == said


@pytest.mark.parametrize("changed", [
    "let a = 2;\n", "let a = 1; let b = 2;\n", "let a = 1;\n", "let a =\n1;\nlet b = 2;\n",
    "let a = 1;  // no\nlet b = 2;\n",
])  # fmt: skip
def test_a_layout_that_would_change_a_token_a_line_or_a_comment_is_refused(changed: str) -> None:
    with pytest.raises(Problem, match="E340"):
        prove("a.ic", "let a = 1;\nlet b = 2;\n", changed)


def test_a_refusal_names_the_place_and_asks_for_a_report() -> None:
    with pytest.raises(Problem) as caught:
        prove("a.ic", "let a = 1;\nlet b = 2;\n", "let a = 1;\nlet b = 3;\n")
    assert (
        render(caught.value.diagnostics, caught.value.sources)
        == """\
error[E340]: laying out this deck would change what it says, so it is left as it is: a defect of MET
 --> a.ic:2:1
  |
2 | let b = 2;
  | ^^^
  = help: please report it together with the deck

1 error
"""
    )
