"""docs/architecture.md describes the tree as it is: every room, and the order in which rooms import one another."""

from __future__ import annotations

import re
from configparser import ConfigParser

from tests.docs.test_pages import ROOT

PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
PACKAGES = ("batch", "hw", "ic", "met")


def rows_of(title: str) -> list[list[str]]:
    """The cells of the first table with this head."""
    lines = PAGE[PAGE.index(f"\n| {title} |") + 1 :].partition("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def rooms() -> set[str]:
    """Every room that the page describes. `met/servos/ sensors/` are two beside one another."""
    found = set()
    for cell, *_ in rows_of("room"):
        first, *others = cell.strip("`").split()
        found |= {first, *(first.rstrip("/").rpartition("/")[0] + "/" + other for other in others)}
    return found


def test_every_folder_of_a_package_is_a_room_of_the_page() -> None:
    there = {f"{each.parent.relative_to(ROOT)}/" for package in PACKAGES for each in ROOT.glob(f"{package}/*/*.py")}
    assert len(there) > 40
    assert there - {"/".join(room.split("/")[:2]) + "/" for room in rooms()} == set()


def test_every_room_of_the_page_is_a_folder() -> None:
    assert [room for room in rooms() if not (ROOT / room).is_dir()] == []


def orders() -> dict[str, str]:
    """By folder, the layers of setup.cfg as the page writes them: what is independent with commas between."""
    parser = ConfigParser()
    parser.read(ROOT / "setup.cfg", encoding="utf-8")
    found = {}
    for section in parser.sections():
        contract = parser[section]
        if section.startswith("importlinter:contract:") and contract["type"] == "layers" and "containers" in contract:
            within = contract["containers"].strip().replace(".", "/")
            layers = [re.findall(r"\w+", layer) for layer in contract["layers"].split("\n") if layer.strip()]
            found[within] = "; ".join(", ".join(f"`{name}`" for name in layer) for layer in layers)
    return found


def test_the_page_has_the_orders_that_the_linter_holds_and_no_others() -> None:
    assert {within.strip("`/"): order for within, order in rows_of("within")} == orders()
