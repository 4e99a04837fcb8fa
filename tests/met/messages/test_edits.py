"""Edits beside helps: found in the text as it stands, or not offered."""

import pickle

from met.diagnostic import Expansion, Help, Label, Place, did_you_mean, error, leave_out, write, write_either
from met.messages.edits import Edit, apply, edits

DECK = """run x like y {
    duration = 2;  recrod = [q, qd];
    require a < 3;  // of all
}
"""


def edited(found, text=DECK, file="a.ic"):
    """The texts that the edits of a diagnostic make, one by one."""
    return [apply(edit, text) for _, edit in edits(found, {file: text})]


def at(line, column, length, **more):
    return Place("a.ic", line, column, length, **more)


def test_a_help_is_its_text_and_keeps_its_changes_through_a_process():
    help = write("2 s")
    assert help == "write `2 s`" and f"{help}" == "write `2 s`"
    again = pickle.loads(pickle.dumps(help))
    assert again == help and isinstance(again, Help) and again.changes == help.changes


def test_the_stretch_at_the_caret_is_replaced():
    found = error("D060", "no", at(2, 16, 1), help=["because", write("2 s", where="value")])
    assert list(edits(found, {"a.ic": DECK})) == [(1, Edit("a.ic", 2, 16, 2, 17, "2 s"))]
    assert edited(found) == [DECK.replace("= 2;", "= 2 s;")]


def test_a_word_is_replaced_where_it_stands_and_not_where_the_text_is_another():
    found = error("D109", "no", at(2, 20, 6), help=did_you_mean("recrod", ["record"]))
    assert edited(found) == [DECK.replace("recrod", "record")]
    assert edited(found, DECK.replace("recrod", "other_")) == []
    assert edited(found, DECK.replace("recrod", "recrods")) == []


def test_an_edit_changes_something():
    found = error("D116", "no", at(2, 20, 6), help=did_you_mean("recrod", ["recrod"]))
    assert found.help == ("did you mean `recrod`?",) and edited(found) == []


def test_an_entry_is_written_anew():
    found = error("D350", "no", at(3, 13, 5), help=write("require a < 4 in 99 % of cases;", where="entry"))
    assert edited(found) == [DECK.replace("require a < 3;", "require a < 4 in 99 % of cases;")]


def test_each_of_several_ways_to_write_it_is_an_edit_of_one_help():
    found = error("D060", "no", at(2, 16, 1), help=write_either(["2 s", "2 min"]))
    assert found.help == ("write `2 s` or `2 min`",)
    assert [(n, edit.text) for n, edit in edits(found, {"a.ic": DECK})] == [(0, "2 s"), (0, "2 min")]


def test_a_value_that_goes_on_behind_its_place_is_left_alone():
    text = "a = 2\n  + 3;\nb = (1 + 2) * 3;\n"
    for place in (at(1, 5, 1), at(3, 6, 10)):
        assert edited(error("D060", "no", place, help=write("2 s", where="value")), text) == []


def test_an_entry_is_left_out_with_its_line_where_nothing_else_is_on_it():
    assert edited(error("D340", "no", at(3, 13, 1), help=leave_out("leave it out"))) == [
        "run x like y {\n    duration = 2;  recrod = [q, qd];\n     // of all\n}\n".replace("     //", "    //")
    ]
    alone = DECK.replace("  // of all", "")
    assert edited(error("D340", "no", at(3, 13, 1), help=leave_out("leave it out")), alone) == [
        "run x like y {\n    duration = 2;  recrod = [q, qd];\n}\n"
    ]
    assert edited(error("D109", "no", at(2, 20, 6), help=leave_out("leave it out"))) == [
        DECK.replace("recrod = [q, qd];", "")
    ]


def test_the_innermost_entry_is_the_one_that_is_left_out():
    text = 'arm a {\n  // a comment; }\n  link b { mass = 1 kg;  name = "};"; }  joint c { at = [1, 2] m; }\n}\n'
    inner = error("D1", "no", at(3, 34, 4), help=leave_out("leave it out"))
    assert edited(inner, text) == [text.replace('name = "};"; ', "")]
    whole = error("D1", "no", at(3, 3, 4), help=leave_out("leave it out"))
    assert edited(whole, text) == [text.replace('link b { mass = 1 kg;  name = "};"; }  ', "")]


def test_an_entry_is_added_at_the_end_of_its_block_and_laid_out_as_the_block_is():
    found = error("D107", "no", at(1, 1, 5), help=write("seed = 3;", where="inside"))
    assert edited(found) == [DECK.replace("all\n}", "all\n    seed = 3;\n}")]
    assert edited(found, "run x { a = 1; }") == ["run x { a = 1; seed = 3; }"]
    assert edited(found, "run x {}") == ["run x { seed = 3; }"]
    assert edited(found, "run x like y;\nrun z { }") == []


def test_text_is_put_before_a_place_and_behind_one():
    place = at(2, 16, 1)
    assert edited(error("D1", "no", place, help=write("-", where="before"))) == [DECK.replace("= 2", "= -2")]
    assert edited(error("D1", "no", place, help=write(" s", where="behind"))) == [DECK.replace("= 2", "= 2 s")]


def test_a_line_at_the_head_of_a_file_stands_behind_its_edition():
    found = error("D1", "no", at(1, 1, 1), help=write("#pragma once", at=at(1, 1, 0), where="head"))
    for before, rest in (
        ("", "run x { }\n"),
        ("deck 2;\n", "run x { }\n"),
        ("// of me\n\n/* deck 1; */ deck 2 ;  // says it\n", "run x { }\n"),
    ):
        assert edited(found, before + rest) == [f"{before}#pragma once\n{rest}"]
    assert edited(found, "deck 2; run x { }\n") == ["deck 2;\n#pragma once\n run x { }\n"]
    assert edited(found, "deck 2;") == ["deck 2;\n#pragma once\n"]


def test_no_edit_is_offered_in_a_macro_or_in_a_deck_of_mets_own_or_where_no_text_is():
    use = at(1, 5, 1)
    made = error("D1", "no", at(2, 16, 1, expansions=(Expansion("M", at(3, 5, 7)),)), help=write("2 s"))
    assert edited(made) == []
    of_argument = error("D1", "no", at(2, 16, 1, expansions=(Expansion("M", use),)), help=write("2 s"))
    assert edited(of_argument) == [DECK.replace("= 2;", "= 2 s;")]
    own = error("D1", "no", Place("<a.ic>", 2, 16, 1), help=write("2 s"))
    assert edited(own, file="<a.ic>") == []
    assert edited(error("D1", "no", at(2, 16, 1), help=write("2 s")), file="b.ic") == []
    assert edited(error("D1", "no", at(9, 1, 1), help=write("2 s"))) == []
    assert edited(error("D1", "no", None, help=write("2 s"))) == []


def test_an_edit_counts_characters_and_knows_what_is_beyond_ascii():
    text = "// \N{GREEK SMALL LETTER OMEGA}\N{ROBOT FACE} a\nx = \N{ROBOT FACE} 2;\r\n"
    found = error("D1", "no", Label(at(2, 7, 1)), help=write("3 s"))
    assert edited(found, text) == [text.replace("2;", "3 s;")]
