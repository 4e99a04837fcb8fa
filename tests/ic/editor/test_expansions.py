"""Names that macros make, and places in the bodies of macros."""

from __future__ import annotations

import pytest

from ic.editor.completion import offers
from ic.editor.index import DeckIndex
from ic.editor.names import NamesInTexts
from ic.editor.structure import DeckText

DECK = """\
#define ROD(NAME, MASS) link NAME { mass = MASS; }
#define EACH(X) X(upper, 1 kg) X(lower, 2 kg)
#define STIFF(OF) servo OF##_stiff like OF { kp = 2 V*s/rad; }
arm two {
    EACH(ROD)
    joint elbow revolute { parent = upper;  child = lower; }
}
servo motor { model = rigid_gearbox; }
STIFF(motor)
run nominal { arm = two;  servos { elbow = motor_stiff; } }
"""


def names() -> NamesInTexts:
    return NamesInTexts([DeckText("deck.ic", DECK)])


@pytest.mark.parametrize(
    ("name", "kind", "written"),
    [
        ("upper", "link", "upper, 1"),
        ("lower", "link", "lower, 2"),
        ("motor_stiff", "servo", "motor)"),
    ],
)
def test_a_name_that_a_macro_makes_is_defined_where_its_argument_stands(name: str, kind: str, written: str) -> None:
    (found,) = names().by_name[name]
    assert found.by_macro and found.kind == kind
    assert found.token.offset == DECK.index(written)


def test_a_parameter_of_a_macro_is_defined_in_its_head_and_defines_nothing() -> None:
    known = names()
    (text,) = known.texts
    use = text.token_at(DECK.index("NAME {"))
    assert use is not None
    (found,) = known.meant_in(text, use)
    assert found.kind == "parameter" and found.token.offset == DECK.index("NAME, MASS")
    assert "NAME" not in known.by_name and "OF_stiff" not in known.by_name


def test_a_body_has_the_entries_of_the_block_that_it_is_of() -> None:
    known = names()
    (text,) = known.texts
    found = [each.word for each in offers(text, DECK.index("mass = MASS"), known, DeckIndex((), ()), ())]
    assert {"mass", "com", "inertia"} <= set(found)
    found = [each.word for each in offers(text, DECK.index("kp = 2"), known, DeckIndex((), ()), ())]
    assert {"model", "command", "rate"} <= set(found)


@pytest.mark.slow
@pytest.mark.parametrize("body", ["X X", "X(X)", "Y", "Y(1) Y(2)", "{ X", "} X {", "X " * 40])
def test_macros_that_use_themselves_end(body: str) -> None:
    text = f"#define X {body}\n#define Y(A) X Z(A) Z(A)\n#define Z(A) {'Y(A) ' * 40}\nX\nY(1)\nX(2) {{ Y( }}\n"
    known = NamesInTexts([DeckText("deck.ic", text)])
    for offset in range(len(text)):
        offers(known.texts[0], offset, known, DeckIndex((), ()), ())
