"""A robot of one bar on one joint, and decks made from it, for tests that change a piece of either."""

from __future__ import annotations

from pathlib import Path

import ic
from ic.driver.compile import Compiled
from met.diagnostic import Problem
from met.messages.render import render
from tests.ic.small_decks import changed, messages

TWO = """\
<robot name="two">
  <link name="ground"/>
  <link name="bar">
    <inertial>
      <origin xyz="0.5 0 0" rpy="0 0 0"/>
      <mass value="2"/>
      <inertia ixx="0.1" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="ground"/>
    <child link="bar"/>
    <axis xyz="0 0 1"/>
  </joint>
</robot>
"""
OTHER = """\
  <link name="tip"/>
  <joint name="other" type="fixed"> <parent link="bar"/> <child link="tip"/> </joint>
</robot>"""
"""Another joint, in the place of the robot's end."""

DECK = """\
arm two from urdf("two.urdf") { }
run fall { arm = two;  rates { dynamics = 1 kHz; }  duration = 10 ms;  record = [q]; }
"""


def check(folder: Path, robot: str | bytes = TWO, deck: str = DECK) -> Compiled:
    """The deck beside the robot, compiled."""
    (folder / "two.urdf").write_bytes(robot if isinstance(robot, bytes) else robot.encode())
    (folder / "deck.ic").write_text(deck, encoding="utf-8")
    return ic.check(folder / "deck.ic")


def said(folder: Path, robot: str | bytes = TWO, deck: str = DECK) -> str:
    """What is told of the deck, without the line that counts."""
    return without_count(messages(check(folder, robot, deck)).replace(str(folder), "DIR"))


def refused(problem: Problem) -> str:
    """The same of a refusal; places by the file's name alone."""
    text = render(problem.diagnostics, problem.sources)
    for name in problem.sources:
        text = text.replace(name, Path(name).name)
    return without_count(text)


def without_count(text: str) -> str:
    return text.rpartition("\n\n")[0] + "\n" if text else ""


__all__ = ["DECK", "OTHER", "TWO", "changed", "check", "refused", "said"]
