"""XML as a tree of elements that know their places: by the standard library's expat, within limits.

A document type and entities of the file's own are refused, so a hostile file cannot expand beyond its length. Text
between elements is left alone, as neither URDF nor MJCF has any.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import cached_property
from xml.parsers import expat

from ic.text.limits import MJCF_DEPTH, MOST_ELEMENTS, XML_DEPTH
from met.diagnostic import Diagnostic, Label, Place, Problem, error

MJCF = ("mujoco", "mujocoinclude")
"""The outermost elements of MJCF files."""
SHOWN = 60  # characters of a name or a value in a message

_ATTRIBUTE = re.compile(rb"""([^\s=<>/"']+)\s*=\s*(?:"[^"]*"|'[^']*')""")
_NO_ROBOT = "a URDF file is XML, `<robot> ... </robot>`, and MJCF `<mujoco> ... </mujoco>`: is this the right file?"
_REMEDY = "a robot's file needs neither: write the values out"


class XmlSource:
    """A file's name and bytes, with the places of bytes in its text."""

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self.data = text.encode("utf-8", errors="replace")

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *(match.end() for match in re.finditer(b"\n", self.data))]

    def place(self, offset: int, stop: int) -> Place:
        """The place of the bytes from `offset` to before `stop`, cut at the end of the line."""
        line = bisect_right(self._starts, offset)
        start = self._starts[line - 1]
        end = self.data.find(b"\n", offset)
        stop = min(stop, len(self.data) if end < 0 else end)
        column = len(self.data[start:offset].decode(errors="replace")) + 1
        return Place(self.name, line, column, max(1, len(self.data[offset:stop].decode(errors="replace"))))


class Element:
    """An element: its tag, the text of its attributes, and its contents, in order."""

    __slots__ = ("_offset", "_source", "attributes", "children", "tag")

    def __init__(self, tag: str, attributes: dict[str, str], source: XmlSource, offset: int) -> None:
        self.tag, self.attributes = tag, attributes
        self.children: list[Element] = []
        self._source, self._offset = source, offset

    @property
    def place(self) -> Place:
        """The `<tag` of its beginning."""
        return self._source.place(self._offset, self._offset + 1 + len(self.tag.encode()))

    def place_of(self, attribute: str) -> Place:
        """The text of an attribute's value, without the quotes."""
        match = self._written(attribute)
        value = match.end() - 1
        quote = self._source.data[value : value + 1]
        return self._source.place(self._source.data.rindex(quote, match.start(), value) + 1, value)

    def name_place(self, attribute: str) -> Place:
        """The attribute's name."""
        return self._source.place(*self._written(attribute).span(1))

    def _written(self, attribute: str) -> re.Match[bytes]:
        """The match of an attribute in the file's bytes, for its place."""
        offset = self._offset + 1 + len(self.tag.encode())
        while (match := _ATTRIBUTE.search(self._source.data, offset)) is not None:
            if match[1] == attribute.encode():
                return match
            offset = match.end()
        raise AssertionError(attribute)

    def all(self, tag: str) -> Iterator[Element]:
        return (child for child in self.children if child.tag == tag)


def parse(name: str, text: str) -> Element:
    """The outermost element. Raises Problem D200 for invalid XML, D201 for expansions, D202 beyond a limit."""
    source = XmlSource(name, text)
    parser = expat.ParserCreate(encoding="utf-8")  # the text's encoding, whatever the file's first line says
    open_: list[Element] = []
    root: list[Element] = []
    count = 0

    def place_here(length: int = 1) -> Place:
        return source.place(parser.CurrentByteIndex, parser.CurrentByteIndex + length)

    def start(tag: str, attributes: dict[str, str]) -> None:
        """Expat's handler of an opening tag: hang its element into the tree. Raises Problem D202 beyond the limits of
        number and depth."""
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            raise Problem(
                error(
                    "D202",
                    f"a robot's file has at most {MOST_ELEMENTS} elements",
                    place_here(),
                    help="a robot has some hundred: is this the right file?",
                )
            )
        most = MJCF_DEPTH if root and root[0].tag in MJCF else XML_DEPTH
        if len(open_) >= most:
            usual = "a robot has some ten bodies in a row" if most == MJCF_DEPTH else "those of URDF go some six deep"
            raise Problem(error("D202", f"elements go deeper than {most}", place_here(), help=usual))
        element = Element(tag, attributes, source, parser.CurrentByteIndex)
        (open_[-1].children if open_ else root).append(element)
        open_.append(element)

    def end(tag: str) -> None:
        open_.pop()

    def document_type(*_: object) -> None:
        """Expat's handler of a document type: raise Problem D201."""
        begin = b"<!DOCTYPE"
        offset = max(0, source.data.rfind(begin, 0, parser.CurrentByteIndex + len(begin)))
        raise Problem(
            error(
                "D201",
                "a document type and entities are not read",
                source.place(offset, offset + len(begin)),
                help=_REMEDY,
            )
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(source.data, True)
    except expat.ExpatError as reason:
        raise Problem(_not_xml(source, parser.ErrorByteIndex, reason.code, open_)) from None
    return root[0]


def _not_xml(source: XmlSource, offset: int, code: int, open_: list[Element]) -> Diagnostic:
    """The diagnostic for an error that expat found, with a remedy."""
    offset = max(0, min(offset, len(source.data) - 1))
    place = source.place(offset, offset + 1)
    why = expat.ErrorString(code) or "it cannot be read"
    name = f"`{open_[-1].tag[:SHOWN]}`" if open_ else ""
    helps = {
        "XML or text declaration not at start of entity": "`<?xml ... ?>` stands at the very beginning of a file, with "
        "nothing before it, or not at all",
        "no element found": f"the file ends inside {name}: its end is missing" if open_ else "the file is empty",
        "mismatched tag": f"{name} is open here: it is to be closed first",
        "junk after document element": "a file has one outermost element, `<robot>`",
        "unclosed token": "`<!--` begins a comment, which `-->` ends"
        if source.data.startswith(b"<!--", offset)
        else "a `<` begins a tag, which `>` ends",
        "not well-formed (invalid token)": _of_token(source.data, offset),
        "duplicate attribute": "an attribute stands once in a tag",
        "undefined entity": "five have a meaning: &lt; &gt; &amp; &quot; &apos;",
        "unbound prefix": 'declare it in `<robot xmlns:PREFIX="...">`',
    }
    left_open = bool(open_) and why in ("mismatched tag", "no element found")
    return error(
        "D200",
        f"`{source.name}` is no XML: {why}",
        place,
        also=[Label(open_[-1].place, "opened here")] if left_open else [],
        help=helps.get(why, _NO_ROBOT),
    )


def _of_token(data: bytes, offset: int) -> str:
    """The remedy for a misplaced token."""
    if data.rfind(b"<!--", 0, offset) > data.rfind(b"-->", 0, offset):
        return "`--` stands in a comment at its end only, as `-->`"
    if re.search(rb"&\w*\Z", data[max(0, offset - SHOWN) : offset]):
        return "`&` is written `&amp;`"
    if data[offset : offset + 1] == b"<":
        return 'in a value `<` is written `&lt;`; else a `"` or a `>` is missing before it'
    if data.rfind(b"<", 0, offset) > data.rfind(b">", 0, offset):
        return 'within a tag stands `NAME="..."`, in quotes, with a blank before it'
    return _NO_ROBOT
