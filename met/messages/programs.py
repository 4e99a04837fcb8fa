"""Diagnostics for programs: JSON, SARIF 2.1.0, and the workflow commands of GitHub Actions.

JSON holds the complete diagnostic. SARIF is the format that code hosts and editors read from checkers: results of
rules, with fixes (https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/). A workflow command makes an annotation
of a pull request. Edits of the deck's text, where a help has one, are in JSON and in SARIF.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

from met.messages.edits import Edit, edits
from met.messages.message import Diagnostic, Label, Place, shown_place
from met.version import VERSION

JSON_VERSION = 1
SARIF_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
PROJECT_PAGE = "docs/diagnostics.md"
LIBRARY_BASE = "METLIBRARY"

Allowed = Iterable[tuple[Diagnostic, str]]
"""Warnings that a run allows, each with the reason."""

_NONE: Mapping[str, str] = MappingProxyType({})


def to_json(
    diagnostics: Iterable[Diagnostic], sources: Mapping[str, str] = _NONE, allowed: Allowed | None = None
) -> str:
    """The diagnostics for programs: an object with `version`, `diagnostics`, `errors` and `warnings`.

    sources  the text of each file by the name that places give it; edits are given of these files alone
    allowed  the warnings of a deck that are not among them, for a run allows them, and why: `allowed` of the object
    """
    listed = tuple(diagnostics)
    result: dict[str, Any] = {
        "version": JSON_VERSION,
        "errors": sum(d.severity == "error" for d in listed),
        "warnings": sum(d.severity == "warning" for d in listed),
        "diagnostics": [_diagnostic_json(d, sources) for d in listed],
    }
    if allowed is not None:
        result["allowed"] = [{**_diagnostic_json(d, sources), "because": because} for d, because in allowed]
    return json.dumps(result, indent=1)


def _diagnostic_json(diagnostic: Diagnostic, sources: Mapping[str, str]) -> dict[str, Any]:
    """A diagnostic for JSON, with its places and the edits of its helps."""
    label = diagnostic.at
    return {
        "code": diagnostic.code,
        "severity": diagnostic.severity,
        "message": diagnostic.message,
        "shown": _place_json(shown_place(label.place)) if label else None,
        "at": _label_json(label) if label else None,
        "also": [_label_json(label) for label in diagnostic.also],
        "help": list(diagnostic.help),
        "edits": [{"help": n, **_edit_json(edit)} for n, edit in edits(diagnostic, sources)],
    }


def _edit_json(edit: Edit) -> dict[str, Any]:
    """An edit for JSON: the stretch, by lines and columns from 1, and its new text."""
    return {
        "file": edit.file,
        "line": edit.line,
        "column": edit.column,
        "end_line": edit.end_line,
        "end_column": edit.end_column,
        "text": edit.text,
    }


def _label_json(label: Label) -> dict[str, Any]:
    return {"place": _place_json(label.place), "text": label.text}


def _place_json(place: Place) -> dict[str, Any]:
    """A place for JSON, with the macros, loops and includes that it came through."""
    record: dict[str, Any] = {"file": place.file, "line": place.line, "column": place.column, "length": place.length}
    if place.macros:
        record["expansions"] = [{"macro": step.macro, "use": _place_json(step.use)} for step in place.macros]
    if place.iterations:
        record["iterations"] = [
            {"index": step.macro, "value": step.iteration, "loop": _place_json(step.use)} for step in place.iterations
        ]
    if place.included:
        record["included"] = [
            {"file": file, "line": line, **({"used": True} if word == "used at" else {})}
            for file, line, word in place.came_by
        ]
    return record


# SARIF


def to_sarif(
    diagnostics: Iterable[Diagnostic],
    sources: Mapping[str, str] = _NONE,
    allowed: Allowed = (),
    titles: Mapping[str, str] = _NONE,
) -> str:
    """The diagnostics as a log of SARIF 2.1.0: a rule for each code, a result for each diagnostic.

    allowed  warnings that a run allows: results that are suppressed in the source, with the reason
    titles   what each code is about, in a line; of a code without one, the message stands there
    """
    pairs = [(diagnostic, None) for diagnostic in diagnostics] + [
        (diagnostic, because) for diagnostic, because in allowed
    ]
    codes = list(dict.fromkeys(diagnostic.code for diagnostic, _ in pairs))
    about = {diagnostic.code: diagnostic.message for diagnostic, _ in reversed(pairs)} | dict(titles)
    results = []
    for diagnostic, because in pairs:
        result = _result(diagnostic, sources, codes.index(diagnostic.code))
        if because is not None:
            result["suppressions"] = [{"kind": "inSource", "justification": because}]
        results.append(result)
    driver = {
        "name": "MET",
        "version": VERSION,
        "rules": [
            {
                "id": code,
                "shortDescription": {"text": about[code]},
                "help": {"text": f"`met doc {code}` explains it, as {PROJECT_PAGE} does."},
            }
            for code in codes
        ],
    }
    run: dict[str, Any] = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "results": results}
    if LIBRARY_BASE in json.dumps(results):
        run["originalUriBaseIds"] = {LIBRARY_BASE: {"description": {"text": "the decks that come with MET"}}}
    return json.dumps({"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1)


def _result(diagnostic: Diagnostic, sources: Mapping[str, str], rule: int) -> dict[str, Any]:
    """A diagnostic as a result of SARIF, with the edits that carry out its help. rule: position of its code among the
    rules."""
    helps = "".join(f"\nhelp: {text}" for text in diagnostic.help)
    result: dict[str, Any] = {
        "ruleId": diagnostic.code,
        "ruleIndex": rule,
        "level": diagnostic.severity,
        "message": {"text": diagnostic.message + helps},
    }
    related = [_location(shown_place(label.place), label.text) for label in diagnostic.also]
    if diagnostic.at is not None:
        place = diagnostic.at.place
        shown_at = shown_place(place)
        result["locations"] = [_location(shown_at, diagnostic.at.text)]
        loops = [
            _location(shown_place(iteration.use), f"in `for {iteration.macro}`, {iteration}")
            for iteration in place.iterations
        ]
        related = loops + related
        if shown_at is not place:
            related.insert(0, _location(place, f"written here, in macro {place.expansions[0].macro}"))
    if related:
        result["relatedLocations"] = related
    fixes = [_fix(diagnostic.help[n], edit) for n, edit in edits(diagnostic, sources)]
    if fixes:
        result["fixes"] = fixes
    return result


def _location(place: Place, text: str) -> dict[str, Any]:
    """A place as a location of SARIF. text: the message about it."""
    location: dict[str, Any] = {}
    if _is_of_the_command_line(place.file):
        location["logicalLocations"] = [{"name": place.file}]
    else:
        region = _region(place.line, place.column, place.line, place.column + place.length)
        location["physicalLocation"] = {"artifactLocation": _artifact(place.file), "region": region}
    if text:
        location["message"] = {"text": text}
    return location


def _artifact(file: str) -> dict[str, str]:
    """The URI of a file: relative to the working folder, or to MET's own decks."""
    if file.startswith("<"):
        return {"uri": quote(file[1:-1]), "uriBaseId": LIBRARY_BASE}
    if os.path.isabs(file):
        return {"uri": "file://" + quote(file)}
    return {"uri": quote(file)}


def _region(line: int, column: int, end_line: int, end_column: int) -> dict[str, int]:
    return {"startLine": line, "startColumn": column, "endLine": end_line, "endColumn": end_column}


def _is_of_the_command_line(file: str) -> bool:
    return file.startswith("<") and " " in file


def _fix(text: str, edit: Edit) -> dict[str, Any]:
    """An edit as a fix of SARIF. text: the help that it carries out"""
    region = _region(edit.line, edit.column, edit.end_line, edit.end_column)
    replacement = {"deletedRegion": region, "insertedContent": {"text": edit.text}}
    changes = [{"artifactLocation": _artifact(edit.file), "replacements": [replacement]}]
    return {"description": {"text": text}, "artifactChanges": changes}


# GitHub Actions

_COMMANDS: Mapping[str, str] = MappingProxyType({"error": "error", "warning": "warning", "note": "notice"})


def to_github(diagnostics: Iterable[Diagnostic]) -> str:
    """The diagnostics as workflow commands, a line each: `::error file=arm.ic,line=3,col=5,...::message`.

    A place in a deck of MET's own, or on the command line, is no file of the repository: it stands in the message.
    """
    return "".join(_command(diagnostic) + "\n" for diagnostic in diagnostics)


def _command(diagnostic: Diagnostic) -> str:
    """A diagnostic as a workflow command of GitHub Actions, one line."""
    properties: dict[str, object] = {}
    about = ""
    if diagnostic.at is not None:
        place = shown_place(diagnostic.at.place)
        if place.file.startswith("<"):
            about = f"{place}: "
        else:
            properties["file"] = os.path.relpath(place.file)
            properties |= {"line": place.line, "endLine": place.line}
            properties |= {"col": place.column, "endColumn": place.column + place.length}
    properties["title"] = diagnostic.code
    written = ",".join(f"{name}={_escaped(str(value), (':', ','))}" for name, value in properties.items())
    label = f" ({diagnostic.at.text})" if diagnostic.at is not None and diagnostic.at.text else ""
    lines = [f"{about}{diagnostic.message}{label}", *(f"help: {text}" for text in diagnostic.help)]
    return f"::{_COMMANDS[diagnostic.severity]} {written}::{_escaped(chr(10).join(lines))}"


def _escaped(text: str, also: tuple[str, ...] = ()) -> str:
    """Text without the characters that end a value of a workflow command, so that no deck can write commands of its
    own."""
    for sign in ("%", "\r", "\n", *also):
        text = text.replace(sign, f"%{ord(sign):02X}")
    return text
