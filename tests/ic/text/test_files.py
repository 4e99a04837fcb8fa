"""Which files a deck is made of: where they are looked for, what they are called, and what no file may do."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

import ic
from ic.text.files import Files, file_at
from met import cli
from met.diagnostic import Problem
from tests.ic.decktext import Desk

# where files are looked for


def test_a_folder_does_not_hide_a_file_of_its_name_further_on(desk: Desk) -> None:
    (desk.directory / "first" / "x.ic").mkdir(parents=True)
    desk.write("found", "second/x.ic")
    made = desk.tokens('#include "x.ic"\n#include <x.ic>', ["first", "second"])
    assert [token.text for token in made.tokens[:-1]] == ["found", "found"]


def test_of_met_deck_path_empty_entries_and_missing_folders_hold_nothing(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.write("here", "x.ic")
    desk.write("there", "b/x.ic")
    monkeypatch.setenv("MET_DECK_PATH", os.pathsep.join(["", "nowhere", "", "b", ""]))
    made = desk.tokens("#include <x.ic>")
    assert [token.text for token in made.tokens[:-1]] == ["there"]


def test_a_missing_file_names_each_folder_once_and_says_which_is_not_there(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MET_DECK_PATH", os.pathsep.join(["nowhere", "library", "library"]))
    assert (
        desk.told("#include <x.ic>", ["library"])
        == """\
error[D005]: cannot find <x.ic>
 --> a.ic:1:10
  |
1 | #include <x.ic>
  |          ^^^^^^
  = help: looked in `library`, `nowhere` (there is no such folder), the standard library

1 error
"""
    )


def test_a_backslash_in_a_files_name_is_named_with_what_to_write(desk: Desk) -> None:
    files = {"sub/part.ic": "let a = 1;", "a.ic": '#include "sub\\part.ic"'}
    told = desk.told(files["a.ic"], (), files)
    assert (
        told
        == """\
error[D005]: cannot find "sub\\part.ic"
 --> a.ic:1:10
  |
1 | #include "sub\\part.ic"
  |          ^^^^^^^^^^^^^
  = help: `\\` does not part folders here: write `"sub/part.ic"`
  = help: looked in `.`, the standard library

1 error
"""
    )
    assert not desk.told('#include "sub/part.ic"', (), files)


def test_a_link_that_leads_nowhere_is_told_as_one(desk: Desk) -> None:
    (desk.directory / "sub").mkdir()
    (desk.directory / "sub" / "x.ic").symlink_to("gone.ic")
    (desk.directory / "sub" / "y.ic").symlink_to("y.ic")
    told = desk.told('#include "b.ic"', (), {"sub/b.ic": "", "b.ic": '#include "sub/x.ic"\n#include "sub/y.ic"\n'})
    assert (
        told
        == """\
error[D005]: cannot find "sub/x.ic"
 --> b.ic:1:10
  |
1 | #include "sub/x.ic"
  |          ^^^^^^^^^^
  = help: `sub/x.ic` is a link to a file that is not there
  = help: looked in `.`, the standard library
  = note: included from a.ic:1

error[D005]: cannot find "sub/y.ic"
 --> b.ic:2:10
  |
2 | #include "sub/y.ic"
  |          ^^^^^^^^^^
  = help: `sub/y.ic` is a link to a file that is not there
  = help: looked in `.`, the standard library
  = note: included from a.ic:1

2 errors
"""
    )


def test_the_search_for_what_was_meant_ends_in_a_folder_of_many_files(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`#include <x.ic>` with `-I` at the root of a disk."""
    walked = []

    def endless(top: str) -> object:
        for i in range(10**9):
            walked.append(i)
            yield top, [], [f"{i}.txt" for i in range(1000)]

    monkeypatch.setattr(os, "walk", endless)
    assert "cannot find <x.ic>" in desk.told("#include <x.ic>")
    assert len(walked) < 100


# once


def test_pragma_once_knows_a_file_by_any_spelling_and_through_links(desk: Desk) -> None:
    desk.write("#pragma once\nx", "real/b.ic")
    (desk.directory / "linked").symlink_to("real")
    (desk.directory / "c.ic").symlink_to("real/b.ic")
    names = ["real/b.ic", "./real//b.ic", "real/../real/b.ic", "linked/b.ic", "c.ic", str(desk.directory / "c.ic")]
    assert desk.texts("\n".join(f'#include "{name}"' for name in names)) == "x"


def test_an_include_guard_works_through_links_and_names_each_file_read(desk: Desk) -> None:
    desk.write("#ifndef B\n#define B\nx\n#endif\n", "b.ic")
    (desk.directory / "c.ic").symlink_to("b.ic")
    made = desk.tokens('#include "b.ic"\n#include "c.ic"\n#include "./b.ic"\n')
    assert [token.text for token in made.tokens[:-1]] == ["x"]
    assert [source.name for source in made.sources] == ["a.ic", "b.ic", "c.ic"]


# names


def test_a_step_up_from_a_linked_folder_is_where_the_link_leads(desk: Desk) -> None:
    desk.write("here", "t.ic")
    desk.write("there", "real/t.ic")
    (desk.directory / "real" / "deep").mkdir()
    (desk.directory / "link").symlink_to("real/deep")
    made = desk.tokens('#include "t.ic"\n#include "link/../t.ic"\n#include "real/../t.ic"')
    assert [token.text for token in made.tokens[:-1]] == ["here", "there", "here"]
    assert [source.name for source in made.sources] == ["a.ic", "t.ic", "link/../t.ic"]


def test_a_file_with_the_name_of_a_library_file_is_not_taken_for_it(desk: Desk) -> None:
    desk.write("mine\n#include <x.ic>", "<x.ic>")
    desk.write("standard", "library/x.ic")
    made = desk.tokens('#include "<x.ic>"')
    assert [token.text for token in made.tokens[:-1]] == ["mine", "standard"]
    assert [source.name for source in made.sources] == ["a.ic", "./<x.ic>", "<x.ic>"]


def test_a_name_in_any_script_is_a_name(desk: Desk) -> None:
    told = desk.told('#include "\u00fcn\u00ef\u8155.ic"\n#include "\u00fcni.ic"\n', (), {"\u00fcn\u00ef\u8155.ic": ""})
    assert (
        told
        == """\
error[D005]: cannot find "\u00fcni.ic"
 --> a.ic:2:10
  |
2 | #include "\u00fcni.ic"
  |          ^^^^^^^^
  = help: did you mean `\u00fcn\u00ef\u8155.ic`?
  = help: looked in `.`, the standard library

1 error
"""
    )


def test_a_name_with_a_line_break_is_shown_on_one_line_and_never_proposed(desk: Desk) -> None:
    assert (
        desk.told('#include "."', (), {"b\nc.ic": "", "d.ic": ""})
        == """\
error[D001]: `.` is a directory, not a deck
 --> a.ic:1:10
  |
1 | #include "."
  |          ^^^
  = help: decks in it: a.ic, d.ic

1 error
"""
    )
    assert "b" not in desk.told('#include "bc.ic"').replace("bc.ic", "").split("help:", 1)[1].split("looked")[0]


def test_a_name_that_is_not_utf_8_is_refused(desk: Desk, capsys: pytest.CaptureFixture[str]) -> None:
    name = os.fsdecode(b"\xff.ic")
    (desk.directory / name).write_text("#include <two_link.ic>\n")
    for words in (["check", name], ["plan", name, "-o", "plan.json"]):
        assert cli.main(words) == 2
        assert (
            capsys.readouterr().err
            == """\
error[D001]: cannot read `\ufffd.ic`: its name is not UTF-8
 = help: give it, or the folder it lies in, another name: plans and archives hold it as text

1 error
"""
        )
    assert not Path("plan.json").exists()


# what is no deck


def test_what_is_wrong_with_an_included_file_is_told_once_and_with_the_includes_that_led_there(desk: Desk) -> None:
    others: dict[str, str | bytes] = {"b.ic": '\n#include "c.ic"\n#include "c.ic"\n', "c.ic": b"let x = 1;\ny \x00;"}
    assert (
        desk.told('#include "b.ic"\n', (), others)
        == """\
error[D002]: `c.ic` is not text: it holds the byte 0x00
 --> c.ic:2:3
  |
2 | y \ufffd;
  |   ^
  = help: is this an archive or a program? A deck is plain text in UTF-8
  = note: included from b.ic:2
  = note: included from a.ic:1

1 error
"""
    )


def test_a_folder_as_an_include_says_which_decks_are_in_it(desk: Desk) -> None:
    others: dict[str, str | bytes] = {"sub/b.ic": "", "sub/c.ic": "", "empty.ic/x": ""}
    assert (
        desk.told('#include "sub"\n#include "empty.ic"\n', (), others)
        == """\
error[D001]: `sub` is a directory, not a deck
 --> a.ic:1:10
  |
1 | #include "sub"
  |          ^^^^^
  = help: decks in it: b.ic, c.ic

error[D001]: `empty.ic` is a directory, not a deck
 --> a.ic:2:10
  |
2 | #include "empty.ic"
  |          ^^^^^^^^^^
  = help: there is no deck in it

2 errors
"""
    )


def test_a_robots_file_and_other_xml_are_no_decks_and_the_message_names_what_reads_them(desk: Desk) -> None:
    others: dict[str, str | bytes] = {
        "arms/two.urdf": "\n  <robot name='two'/>",
        "two.sdf": "<?xml version='1.0'?>\n<sdf/>",
    }
    assert (
        desk.told('#include "arms/two.urdf"\n#include "two.sdf"\n', (), others)
        == """\
error[D002]: `arms/two.urdf` is XML, not a deck
 --> arms/two.urdf:2:3
  |
2 |   <robot name='two'/>
  |   ^
  = help: `met import arms/two.urdf -o robot.ic` makes a deck of a robot's URDF file
  = help: a deck can take such a file as it is: `arm NAME from urdf("two.urdf") { ... }`
  = note: included from a.ic:1

error[D002]: `two.sdf` is XML, not a deck
 --> two.sdf:1:1
  |
1 | <?xml version='1.0'?>
  | ^
  = help: a deck is text in a language of its own; of robots in XML, `met import` reads URDF and MJCF
  = note: included from a.ic:2

2 errors
"""
    )


def test_a_pipe_and_a_device_are_not_read(desk: Desk) -> None:
    os.mkfifo(desk.directory / "pipe.ic")
    assert (
        desk.told('#include "pipe.ic"\n#include "/dev/zero"\n')
        == """\
error[D001]: `pipe.ic` is not a regular file
 --> a.ic:1:10
  |
1 | #include "pipe.ic"
  |          ^^^^^^^^^
  = help: copy what it gives to a file

error[D001]: `/dev/zero` is not a regular file
 --> a.ic:2:10
  |
2 | #include "/dev/zero"
  |          ^^^^^^^^^^^
  = help: copy what it gives to a file

2 errors
"""
    )


def test_a_file_that_may_not_be_read_says_so(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.stat

    def stat(path: object, *rest: object, **more: object) -> object:
        if str(path).endswith("secret.ic") and not more:
            raise PermissionError(13, "Permission denied", path)
        return real(path, *rest, **more)  # type: ignore[call-overload]

    desk.write("", "secret.ic")
    monkeypatch.setattr("os.path.exists", lambda path: os.path.lexists(path))
    monkeypatch.setattr(os, "stat", stat)
    assert (
        desk.told('#include "secret.ic"\n')
        == """\
error[D001]: cannot read `secret.ic`: Permission denied
 --> a.ic:1:10
  |
1 | #include "secret.ic"
  |          ^^^^^^^^^^^
  = help: look at the name, and at who may read the file

1 error
"""
    )


def test_a_large_file_is_refused_at_its_include(desk: Desk) -> None:
    assert (
        desk.told('\n#include "large.ic"\n', (), {"large.ic": "a" * (2 << 20) + "b"})
        == """\
error[D018]: `large.ic` has 2.0 MiB; a deck's file has at most 2 MiB
 --> a.ic:2:10
  |
2 | #include "large.ic"
  |          ^^^^^^^^^^
  = help: numbers in bulk belong in a CSV file, not in a deck

1 error
"""
    )


def test_a_file_that_does_not_say_its_size_is_not_cut() -> None:
    status = "/proc/self/status"
    assert Path(status).stat().st_size == 0
    with pytest.raises(Problem, match=f"D018: `{status}` has no end"):
        Files().text(file_at(status), most=100)


def test_a_circle_through_a_link_is_a_circle(desk: Desk) -> None:
    desk.write('#include "c.ic"\n', "b.ic")
    (desk.directory / "c.ic").symlink_to("b.ic")
    assert (
        desk.told('#include "b.ic"\n')
        == """\
error[D006]: circular include: b.ic -> c.ic
 --> b.ic:1:10
  |
1 | #include "c.ic"
  |          ^^^^^^
  = help: `#pragma once` at the head of a file lets it be read only once
  = note: included from a.ic:1

1 error
"""
    )


def test_includes_that_go_too_deep_are_told_at_the_one_that_is_too_deep(desk: Desk) -> None:
    others = {f"b{i}.ic": f'#include "b{i + 1}.ic"\n' for i in range(60)}
    told = desk.told('#include "b0.ic"\n', (), others)
    assert (
        told
        == """\
error[D006]: includes go deeper than 50 files
 --> b49.ic:1:10
  |
1 | #include "b50.ic"
  |          ^^^^^^^^
  = note: included from b48.ic:1
  = note: included from b47.ic:1
  = note: included from b46.ic:1
  = note: included from b45.ic:1
  = note: ... 42 files more ...
  = note: included from b2.ic:1
  = note: included from b1.ic:1
  = note: included from b0.ic:1
  = note: included from a.ic:1

1 error
"""
    )


# what a plan keeps


@pytest.mark.slow
def test_a_plan_holds_the_text_and_the_hash_of_every_file_that_was_read(desk: Desk) -> None:
    deck = b'\xef\xbb\xbf#include <two_link.ic>\r\n#include "mine.ic"\r\n#if 0\r\n#include "left_out.ic"\r\n#endif\r\n'
    mine = "// \u00b5\nlet span = 1 m;\n"
    desk.write(deck)
    desk.write(mine, "mine.ic")
    plan = ic.compile("a.ic", select="all")
    kept = {source.name: source for source in plan.sources}
    library = Path(ic.__file__).parent / "decks"
    assert list(kept) == ["a.ic", "<two_link.ic>", "<servos/rigid_gearbox.ic>", "mine.ic"]
    assert kept["a.ic"].sha256 == hashlib.sha256(deck).hexdigest()
    assert kept["mine.ic"].sha256 == hashlib.sha256(mine.encode()).hexdigest()
    assert kept["mine.ic"].text == mine
    for name in ("two_link.ic", "servos/rigid_gearbox.ic"):
        assert kept[f"<{name}>"].sha256 == hashlib.sha256((library / name).read_bytes()).hexdigest()


def test_an_archive_in_the_place_of_a_deck_is_told_with_the_commands_that_show_it(desk: Desk) -> None:
    archive = b"\x89HDF\r\n\x1a\n" + bytes(4 << 20)  # larger than a deck may be
    text = desk.told('#include "a.h5"\n', (), {"a.h5": archive})
    assert "error[D002]: `a.h5` is an archive (HDF5), not a deck\n" in text
    assert "`met show a.h5` and `met report a.h5` show what is in it" in text
