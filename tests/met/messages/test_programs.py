"""SARIF and GitHub's workflow commands, by their specifications."""

import json

from met.diagnostic import Expansion, Label, Place, error, write
from met.messages.message import Diagnostic
from met.messages.programs import to_github, to_json, to_sarif

USE = Place("two.ic", 3, 3, 3)
SOURCES = {"arms/a b.ic": "let x = 2;\n", "two.ic": "a\nb\n  ROD\n", "<command line>": "", "<ideal.ic>": "x"}
FOUND = [
    error("D060", "no unit", Label(Place("arms/a b.ic", 1, 9), "bare"), also=[Label(USE, "there")], help=write("2 s")),
    error("D060", "none", Label(Place("c.ic", 1, 5, 3, (Expansion("ROD", USE),), (("a.ic", 3),)), "why"), help="so"),
    Diagnostic("D105", "near", Label(Place("<ideal.ic>", 2, 1, 4)), (), (), "warning"),
    Diagnostic("D037", "unused", Label(Place("<command line>", 1, 1, 4)), (), (), "note"),
    error("E300", "it is there already"),
]
ALLOWED = [(Diagnostic("D297", "heavy", Label(USE), (), (), "warning"), "it is meant so")]


def test_json_has_the_edits_of_each_diagnostic_with_the_number_of_their_help():
    found = json.loads(to_json(FOUND, SOURCES))
    edit = {"help": 0, "file": "arms/a b.ic", "line": 1, "column": 9, "end_line": 1, "end_column": 10, "text": "2 s"}
    assert [each["edits"] for each in found["diagnostics"]] == [[edit], [], [], [], []]


def log():
    return json.loads(to_sarif(FOUND, SOURCES, ALLOWED, {"D060": "a bare number"}))


def test_sarif_is_a_log_of_one_run_with_a_rule_for_each_code():
    found = log()
    assert found["version"] == "2.1.0" and found["$schema"].endswith("/sarif-schema-2.1.0.json")
    [run] = found["runs"]
    driver = run["tool"]["driver"]
    rules = [rule["id"] for rule in driver["rules"]]
    assert driver["name"] == "MET" and rules == ["D060", "D105", "D037", "E300", "D297"]
    assert [rule["shortDescription"]["text"] for rule in driver["rules"]][:2] == ["a bare number", "near"]
    for result in run["results"]:
        assert rules[result["ruleIndex"]] == result["ruleId"]
        assert result["level"] in ("error", "warning", "note") and result["message"]["text"]
    assert [each["level"] for each in run["results"]] == ["error", "error", "warning", "note", "error", "warning"]
    assert run["columnKind"] == "unicodeCodePoints"


def test_a_result_of_sarif_has_places_as_regions_whose_end_is_behind_them():
    first, made, own, given, nowhere, _ = log()["runs"][0]["results"]
    assert first["locations"] == [
        {
            "physicalLocation": {
                "artifactLocation": {"uri": "arms/a%20b.ic"},
                "region": {"startLine": 1, "startColumn": 9, "endLine": 1, "endColumn": 10},
            },
            "message": {"text": "bare"},
        }
    ]
    assert first["message"]["text"] == "no unit\nhelp: write `2 s`"
    # what a macro made is shown where it is used, and its body is related
    assert made["locations"][0]["physicalLocation"]["artifactLocation"] == {"uri": "two.ic"}
    assert made["relatedLocations"][0]["physicalLocation"]["artifactLocation"] == {"uri": "c.ic"}
    assert own["locations"][0]["physicalLocation"]["artifactLocation"] == {"uri": "ideal.ic", "uriBaseId": "METLIBRARY"}
    assert given["locations"] == [{"logicalLocations": [{"name": "<command line>"}]}]
    assert "locations" not in nowhere


def test_what_a_run_allows_is_suppressed_in_sarif_with_the_reason():
    assert log()["runs"][0]["results"][-1]["suppressions"] == [{"kind": "inSource", "justification": "it is meant so"}]


def test_a_fix_of_sarif_is_the_edit():
    assert log()["runs"][0]["results"][0]["fixes"] == [
        {
            "description": {"text": "write `2 s`"},
            "artifactChanges": [
                {
                    "artifactLocation": {"uri": "arms/a%20b.ic"},
                    "replacements": [
                        {
                            "deletedRegion": {"startLine": 1, "startColumn": 9, "endLine": 1, "endColumn": 10},
                            "insertedContent": {"text": "2 s"},
                        }
                    ],
                }
            ],
        }
    ]


def test_an_absolute_path_is_a_file_uri():
    found = json.loads(to_sarif([error("D060", "no", Place("/home/me/my deck#1.ic", 1, 1))]))
    location = found["runs"][0]["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]
    assert location == {"uri": "file:///home/me/my%20deck%231.ic"}


def test_a_workflow_command_names_the_file_and_the_place_and_escapes_what_would_end_it():
    found = error("D060", "50 % of\nit", Place("a,b:c.ic", 4, 9, 3), help="write `2 s`")
    assert to_github([found]) == (
        "::error file=a%2Cb%3Ac.ic,line=4,endLine=4,col=9,endColumn=12,title=D060::50 %25 of%0Ait%0Ahelp: write `2 s`\n"
    )


def test_a_workflow_command_has_no_file_where_the_repository_has_none():
    assert to_github(FOUND[2:]) == (
        "::warning title=D105::<ideal.ic>:2:1: near\n"
        "::notice title=D037::<command line>:1:1: unused\n"
        "::error title=E300::it is there already\n"
    )


def test_json_has_a_version_and_every_place():
    place = Place("c.ic", 1, 5, 3, (Expansion("ROD", USE),), (("a.ic", 3),))
    found = [error("D028", "no", Label(place, "why"), also=[Label(USE, "there")], help="so")]
    assert json.loads(to_json(found)) == {
        "version": 1,
        "errors": 1,
        "warnings": 0,
        "diagnostics": [
            {
                "code": "D028",
                "severity": "error",
                "message": "no",
                "shown": {"file": "two.ic", "line": 3, "column": 3, "length": 3},
                "at": {
                    "place": {
                        "file": "c.ic",
                        "line": 1,
                        "column": 5,
                        "length": 3,
                        "expansions": [
                            {"macro": "ROD", "use": {"file": "two.ic", "line": 3, "column": 3, "length": 3}}
                        ],
                        "included": [{"file": "a.ic", "line": 3}],
                    },
                    "text": "why",
                },
                "also": [{"place": {"file": "two.ic", "line": 3, "column": 3, "length": 3}, "text": "there"}],
                "help": ["so"],
                "edits": [],
            }
        ],
    }
