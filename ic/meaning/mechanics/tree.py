"""The check that the links and joints of an arm form a tree on its base."""

from __future__ import annotations

from ic.meaning.mechanics.foreign import how_to_close
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Label, Place
from met.plan import BASE, Joint, Link


def check_tree(scope: Scope, name: str, links: list[Link], joints: list[Joint], *, complete: bool = True) -> None:
    """Check that every link has one joint to its parent, and every chain of parents ends at the base.

    complete  all joints are there; else a link without one says nothing
    """
    holder: dict[str, Joint] = {}
    for joint in joints:
        if joint.child in holder:
            first = holder[joint.child]
            scope.complaints.error(
                "D098",
                f"link `{joint.child}` has two parents",
                Label(_place(joint), f"`{joint.parent}`"),
                also=[Label(_place(first), f"`{first.parent}`, by joint `{first.name}`")],
                help=["a branch is a parent with two children", *how_to_close(scope, joint, _place(joint))],
            )
            continue
        holder[joint.child] = joint
    failed = {link.name for link in links} - set(holder) - {BASE}
    settled = {BASE} | failed
    for link in links:
        chain: list[Joint] = []
        current = link.name
        passed: dict[str, int] = {}
        while current in holder and current not in settled and current not in passed:
            passed[current] = len(chain)
            chain.append(holder[current])
            current = holder[current].parent
        if current in passed:
            _complain_loop(scope, chain[passed[current] :][::-1])
        settled.update(passed)
    for link in links:
        if link.name in failed and complete:
            scope.complaints.error(
                "D099",
                f"link `{link.name}` hangs in the air: no joint of arm `{name}` has it for a child",
                link.place,
                help=f"write `joint NAME revolute {{ parent = base; child = {link.name}; axis = z; }}`",
            )


def _complain_loop(scope: Scope, loop: list[Joint]) -> None:
    """Report joints that make a loop which does not hang on the base (D086), from the parent of the first."""
    path = " -> ".join([loop[0].parent, *(joint.child for joint in loop)])
    scope.complaints.error(
        "D086",
        "these joints make a loop, which hangs on no base: " + path,
        Label(_place(loop[-1]), f"joint `{loop[-1].name}` closes it"),
        also=[Label(_place(joint), f"joint `{joint.name}`") for joint in loop[:-1]],
        help="one of them should have `parent = base;`",
    )


def _place(joint: Joint) -> Place:
    assert joint.place is not None  # joints from a deck have one
    return joint.place
