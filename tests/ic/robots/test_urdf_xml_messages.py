"""What is no URDF file, or no XML: whole messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.robots.test_urdf_messages import mistake
from tests.ic.robots.two import said


def no_robot(what: str, text: str | bytes, *, says: str) -> tuple[str, str | bytes, str]:
    return what, text, says


MISTAKES = [  # what, the file's text, what is said
    mistake(
        "xacro",
        (
            '<robot name="two">',
            '<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">\n  <xacro:property name="mass" value="2"/>',
        ),
        says="""\
error[D203]: `<xacro:property>` is not URDF
 --> two.urdf:2:3
  |
2 |   <xacro:property name="mass" value="2"/>
  |   ^^^^^^^^^^^^^^^
  = help: this is xacro, from which a URDF file is made: run `xacro FILE > robot.urdf` and take that
""",
    ),
    mistake(
        "what xacro would fill in",
        ('value="2"', 'value="${mass}"'),
        says="""\
error[D203]: `${mass}` is to be filled in
 --> two.urdf:6:20
  |
6 |       <mass value="${mass}"/>
  |                    ^^^^^^^
  = help: this is xacro, from which a URDF file is made: run `xacro FILE > robot.urdf` and take that
""",
    ),
    mistake(
        "a name that xacro would make",
        ('"hinge"', '"${prefix}hinge"'),
        says="""\
error[D203]: `${prefix}hinge` is to be filled in
  --> two.urdf:10:16
   |
10 |   <joint name="${prefix}hinge" type="revolute">
   |                ^^^^^^^^^^^^^^
   = help: this is xacro, from which a URDF file is made: run `xacro FILE > robot.urdf` and take that
""",
    ),
    mistake(
        "a document type",
        ("<robot", '<?xml version="1.0"?>\n<!DOCTYPE robot [ <!ENTITY lol "lol"> ]>\n<robot'),
        says="""\
error[D201]: a document type and entities are not read
 --> two.urdf:2:1
  |
2 | <!DOCTYPE robot [ <!ENTITY lol "lol"> ]>
  | ^^^^^^^^^
  = help: a robot's file needs neither: write the values out
""",
    ),
    mistake(
        "a tag that closes another",
        ("</link>", "</lnk>"),
        says="""\
error[D200]: `two.urdf` is no XML: mismatched tag
 --> two.urdf:9:5
  |
9 |   </lnk>
  |     ^
 ::: two.urdf:3:3  opened here
  = help: `link` is open here: it is to be closed first
""",
    ),
    mistake(
        "a file that ends too soon",
        ("</robot>\n", ""),
        says="""\
error[D200]: `two.urdf` is no XML: no element found
  --> two.urdf:14:11
   |
14 |   </joint>
   |           ^
  ::: two.urdf:1:1  opened here
   = help: the file ends inside `robot`: its end is missing
""",
    ),
    mistake(
        "a declaration that comes late",
        ("<robot", '<!-- two -->\n<?xml version="1.0"?>\n<robot'),
        says="""\
error[D200]: `two.urdf` is no XML: XML or text declaration not at start of entity
 --> two.urdf:2:1
  |
2 | <?xml version="1.0"?>
  | ^
  = help: `<?xml ... ?>` stands at the very beginning of a file, with nothing before it, or not at all
""",
    ),
    mistake(
        "an entity",
        ('name="bar"', 'name="&bar;"'),
        says="""\
error[D200]: `two.urdf` is no XML: undefined entity
 --> two.urdf:3:3
  |
3 |   <link name="&bar;">
  |   ^
  = help: five have a meaning: &lt; &gt; &amp; &quot; &apos;
""",
    ),
    no_robot(
        "an empty file",
        "",
        says="""\
error[D200]: `two.urdf` is no XML: no element found
 --> two.urdf:1:1
  |
1 |
  | ^
  = help: the file is empty
""",
    ),
    no_robot(
        "text",
        "hello\n",
        says="""\
error[D200]: `two.urdf` is no XML: syntax error
 --> two.urdf:1:1
  |
1 | hello
  | ^
  = help: a URDF file is XML, `<robot> ... </robot>`, and MJCF `<mujoco> ... </mujoco>`: is this the right file?
""",
    ),
    no_robot(
        "another format",
        '<sdf version="1.7"/>\n',
        says="""\
error[D203]: `<sdf>` is not URDF: this is SDF
 --> two.urdf:1:1
  |
1 | <sdf version="1.7"/>
  | ^^^^
  = help: a URDF file is `<robot name="..."> ... </robot>`
""",
    ),
    no_robot(
        "an empty robot",
        '<robot name="none"/>\n',
        says="""\
error[D209]: this robot is empty: it has no links
 --> two.urdf:1:1
  |
1 | <robot name="none"/>
  | ^^^^^^
  = help: an arm has a joint at least
""",
    ),
    no_robot(
        "one body",
        '<robot name="one"> <link name="all"/> </robot>\n',
        says="""\
error[D209]: this robot has no joints: it is one body
 --> two.urdf:1:1
  |
1 | <robot name="one"> <link name="all"/> </robot>
  | ^^^^^^
  = help: an arm has a joint at least
""",
    ),
    no_robot(
        "bytes",
        b'<robot name="\xff"/>\n',
        says="""\
error[D002]: `two.urdf` is not UTF-8: byte 0xff
 --> two.urdf:1:14
  |
1 | <robot name="�"/>
  |              ^
  = help: save the file as UTF-8
""",
    ),
    no_robot(
        "a program",
        b"\x7fELF\x00\x00",
        says="""\
error[D002]: `two.urdf` is not text: it holds the byte 0x7f
 --> two.urdf:1:1
  |
1 | �ELF��
  | ^
  = help: is this an archive or a program? A URDF file is plain text in UTF-8
""",
    ),
]


@pytest.mark.parametrize(("text", "remedy"), [
    ('<robot name="a & b"/>', "`&` is written `&amp;`"),
    ('<robot name="a < b"/>',
     "in a value `<` is written `&lt;`; else a `\"` or a `>` is missing before it"),
    ('<robot name="a>\n<link name="b"/></robot>',
     "in a value `<` is written `&lt;`; else a `\"` or a `>` is missing before it"),
    ("<robot name=two/>", 'within a tag stands `NAME="..."`, in quotes, with a blank before it'),
    ("<robot><!-- the left -- and the right --></robot>", "`--` stands in a comment at its end only, as `-->`"),
    ("<robot><!-- the left </robot>", "`<!--` begins a comment, which `-->` ends"),
    ("<robot><link", "a `<` begins a tag, which `>` ends"),
])  # fmt: skip
def test_what_is_no_xml_is_told_with_what_to_do(text: str, remedy: str, tmp_path: Path) -> None:
    assert said(tmp_path, text).endswith(f"  = help: {remedy}\n")


@pytest.mark.slow
@pytest.mark.parametrize(("text", "says"), [each[1:] for each in MISTAKES], ids=[each[0] for each in MISTAKES])
def test_a_mistake_is_told_at_its_place(text: str | bytes, says: str, tmp_path: Path) -> None:
    assert said(tmp_path, text) == says
