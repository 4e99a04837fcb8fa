"""Mistakes in naming a URDF file in a deck: whole messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.robots.two import DECK, TWO, said

NAMING = [  # what, the deck's first line, what is said
    (
        "a file that is not there",
        'arm two from urdf("tow.urdf") { }',
        """\
error[D215]: cannot find "tow.urdf"
 --> deck.ic:1:19
  |
1 | arm two from urdf("tow.urdf") { }
  |                   ^^^^^^^^^^
  = help: did you mean `two.urdf`?
  = help: looked in `DIR`, the standard library
""",
    ),
    (
        "a file of no name",
        'arm two from urdf("") { }',
        """\
error[D215]: cannot find ""
 --> deck.ic:1:19
  |
1 | arm two from urdf("") { }
  |                   ^^
  = help: looked in `DIR`, the standard library
""",
    ),
    (
        "no quotes",
        "arm two from urdf(two) { }",
        """\
error[D214]: `urdf` takes the name of one file, in quotes
 --> deck.ic:1:14
  |
1 | arm two from urdf(two) { }
  |              ^^^^^^^^^
  = help: write `arm NAME from urdf("FILE") { ... }`
""",
    ),
    (
        "two files",
        'arm two from urdf("two.urdf", "two.urdf") { }',
        """\
error[D214]: `urdf` takes the name of one file, in quotes
 --> deck.ic:1:14
  |
1 | arm two from urdf("two.urdf", "two.urdf") { }
  |              ^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: write `arm NAME from urdf("FILE") { ... }`
""",
    ),
    (
        "a named argument",
        'arm two from urdf(file = "two.urdf") { }',
        """\
error[D214]: `urdf` takes the name of one file, in quotes
 --> deck.ic:1:14
  |
1 | arm two from urdf(file = "two.urdf") { }
  |              ^^^^^^^^^^^^^^^^^^^^^^^
  = help: write `arm NAME from urdf("FILE") { ... }`
""",
    ),
    (
        "nothing in the brackets",
        "arm two from urdf() { }",
        """\
error[D214]: `urdf` takes the name of one file, in quotes
 --> deck.ic:1:14
  |
1 | arm two from urdf() { }
  |              ^^^^^^
  = help: write `arm NAME from urdf("FILE") { ... }`
""",
    ),
    (
        "another format",
        'arm two from sdf("two.urdf") { }',
        """\
error[D214]: no arm is made from `sdf`
 --> deck.ic:1:14
  |
1 | arm two from sdf("two.urdf") { }
  |              ^^^
  = help: an arm is made from: urdf
""",
    ),
    (
        "a file without its format",
        'arm two from "two.urdf" { }',
        """\
error[D020]: a file is named by what it is
 --> deck.ic:1:14
  |
1 | arm two from "two.urdf" { }
  |              ^^^^^^^^^^
  = help: write `from urdf("two.urdf")`
""",
    ),
    (
        "a file without quotes",
        "arm two from two.urdf { }",
        """\
error[D020]: the name of a file stands in quotes
 --> deck.ic:1:14
  |
1 | arm two from two.urdf { }
  |              ^^^^^^^^
  = help: write `from urdf("two.urdf")`
""",
    ),
    (
        "a path without quotes",
        "arm two from ../my_arms/two-link.urdf;",
        """\
error[D020]: the name of a file stands in quotes
 --> deck.ic:1:14
  |
1 | arm two from ../my_arms/two-link.urdf;
  |              ^^^^^^^^^^^^^^^^^^^^^^^^
  = help: write `from urdf("../my_arms/two-link.urdf")`
""",
    ),
    (
        "a file without brackets and quotes",
        "arm two from urdf robots/two.urdf { }",
        """\
error[D020]: the name of a file stands in quotes
 --> deck.ic:1:19
  |
1 | arm two from urdf robots/two.urdf { }
  |                   ^^^^^^^^^^^^^^^
  = help: write `from urdf("robots/two.urdf")`
""",
    ),
    (
        "no block",
        'arm two from urdf("two.urdf")',
        """\
error[D020]: expected `{` or `;`, found `run`
 --> deck.ic:2:1
  |
2 | run fall { arm = two;  rates { dynamics = 1 kHz; }  duration = 10 ms;  record = [q]; }
  | ^^^
  = help: a block holds what differs from the file; `;` stands for none
""",
    ),
    (
        "a unit",
        'arm two from urdf("two.urdf") m { }',
        """\
error[D020]: expected `{` or `;`, found `m`
 --> deck.ic:1:31
  |
1 | arm two from urdf("two.urdf") m { }
  |                               ^
  = help: a block holds what differs from the file; `;` stands for none
""",
    ),
    (
        "two bases",
        'arm two like one from urdf("two.urdf") { }',
        """\
error[D032]: `like` and `from` both name a base
 --> deck.ic:1:18
  |
1 | arm two like one from urdf("two.urdf") { }
  |                  ^^^^
  = help: there is one base only
""",
    ),
    (
        "two bases the other way",
        'arm two from urdf("two.urdf") like one { }',
        """\
error[D032]: `from` and `like` both name a base
 --> deck.ic:1:31
  |
1 | arm two from urdf("two.urdf") like one { }
  |                               ^^^^
  = help: there is one base only
""",
    ),
    (
        "a servo",
        'servo two from urdf("two.urdf") { }',
        """\
error[D214]: a servo is not made from a file
 --> deck.ic:1:16
  |
1 | servo two from urdf("two.urdf") { }
  |                ^^^^
  = help: `from urdf(...)` makes an arm
""",
    ),
    (
        "a link that is there",
        'arm two from urdf("two.urdf") { link bar { mass = 1 kg; } }',
        """\
error[D053]: link `bar` is in `two` already
 --> deck.ic:1:33
  |
1 | arm two from urdf("two.urdf") { link bar { mass = 1 kg; } }
  |                                 ^^^^^^^^
 ::: two.urdf:3:15  here
  = help: leave out the word `link` to change it
  = help: `remove bar;` first, to put another in its place
""",
    ),
    (
        "a link that is not",
        'arm two from urdf("two.urdf") { bra { mass = 1 kg; } }',
        """\
error[D083]: nothing named `bra` to change in this arm
 --> deck.ic:1:33
  |
1 | arm two from urdf("two.urdf") { bra { mass = 1 kg; } }
  |                                 ^^^
  = help: did you mean `bar`?
  = help: `link bra { ... }` or `joint bra revolute { ... }` would add one
""",
    ),
    (
        "the root by its own name",
        'arm two from urdf("two.urdf") { hinge { parent = ground; } }',
        """\
error[D094]: no link `ground` in this arm
 --> deck.ic:1:50
  |
1 | arm two from urdf("two.urdf") { hinge { parent = ground; } }
  |                                                  ^^^^^^
  = help: `ground` is the root of its robot: write `base`
  = help: links: base, bar
""",
    ),
]


@pytest.mark.parametrize(("line", "says"), [each[1:] for each in NAMING], ids=[each[0] for each in NAMING])
def test_a_mistake_in_naming_a_file_is_told(line: str, says: str, tmp_path: Path) -> None:
    assert said(tmp_path, TWO, line + "\n" + DECK.partition("\n")[2]) == says
