"""Broken and hostile MJCF files end in a diagnostic, soon, and read no file outside of their folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from ic.driver.import_robot import import_robot
from met.diagnostic import Problem
from met.messages.render import render
from tests.ic.robots.mjcf_models import ARM, needs_mujoco

LOLS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10 if i else "lol"}">' for i in range(12))
BODY = '<body name="{name}"> <joint name="j{name}"/> <inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/> {more}</body>'


def model(name: str = "a", more: str = "", after: str = "") -> str:
    return f"<mujoco><worldbody>{BODY.format(name=name, more=more)}</worldbody>{after}</mujoco>"


def chain(length: int) -> str:
    text = ""
    for i in range(length):
        text = BODY.format(name=f"b{i}", more=text)
    return f"<mujoco><worldbody>{text}</worldbody></mujoco>"


EARLY = {
    "an entity that expands without end": ("D201", f"<!DOCTYPE a [{LOLS}]><mujoco>&l11;</mujoco>"),
    "a file of this machine": ("D201", '<!DOCTYPE m [<!ENTITY f SYSTEM "file:///etc/hostname">]><mujoco model="&f;"/>'),
    "half a file": ("D200", ARM[: len(ARM) // 2]),
    "bodies within each other without end": ("D202", chain(250)),
    "elements without end": ("D202", "<mujoco>" + "<size/>" * 60_000 + "</mujoco>"),
    "a file of another folder": ("D215", model(after='<include file="../secret.xml"/>')),
    "a file by its whole path": ("D215", model(after='<include file="/etc/hostname"/>')),
    "a link out of the folder": ("D215", model(after='<include file="linked.xml"/>')),
    "a folder": ("D215", model(after='<include file="folder"/>')),
    "a file that is not there": ("D215", model(after='<include file="none.xml"/>')),
    "an include without a name": ("D215", model(after="<include/>")),
    "a file that includes itself": ("D204", model(after='<include file="itself.xml"/>')),
    "an included file that is no XML": ("D200", model(after='<include file="no.xml"/>')),
    "bodies without end": ("D208", model(more='<replicate count="1000000000"><body/></replicate>')),
    "another model": ("D208", model(more='<attach model="other" prefix="o"/>')),
    "no number": ("D206", model().replace('pos="1 0 0"', 'pos="NaN 0 0"')),
    "no number with a sign": ("D206", model().replace('pos="1 0 0"', 'pos="1 -nan 0"')),
    "no number with a payload": ("D206", model().replace('pos="1 0 0"', 'pos="1 0 nan(7)"')),
    "a total mass of bodies that are fused": ("D208", model(
        after='<compiler settotalmass="5"/> <compiler fusestatic="true"/>')),
    "a model within a model": ("D208", model(after="<mujoco/>")),
    "a misspelled element": ("D208", model(more="<jiont/>")),
    "a mesh of another folder": ("D215", '<mujoco><asset><mesh name="m" file="../m.stl"/></asset><worldbody>'
     '<body><joint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'),
    "a mesh that is not there": ("D215", '<mujoco><asset><mesh file="m.stl"/></asset><worldbody>'
     '<body><joint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'),
}  # fmt: skip
"""Texts with the code that they are refused by before MuJoCo sees them."""

LATE = {
    "a ball": ("D212", model(more='<body> <joint type="ball"/> <geom size="1"/> </body>')),
    "a wrong attribute": ("D269", model(more='<body poz="1 0 0"/>')),
    "a unit": ("D269", model().replace('mass="1"', 'mass="1 kg"')),
    "an infinite mass": ("D269", model().replace('mass="1"', 'mass="inf"')),
    "a negative mass": ("D269", model().replace('mass="1"', 'mass="-1"')),
    "an inertia of no body": ("D269", model().replace('"1 1 1"', '"1 1 9"')),
    "two bodies of one name": ("D269", model(more=BODY.format(name="a", more=""))),
    "an axis of length 0": ("D269", model().replace("<joint", '<joint axis="0 0 0"')),
    "no mass": ("D269", model().replace('mass="1"', 'mass="0"')),
    "a range upside down": ("D269", model().replace("<joint", '<joint limited="true" range="1 -1"')),
    "no joints": ("D209", '<mujoco><worldbody><body><geom size="1"/></body></worldbody></mujoco>'),
    "nothing": ("D209", "<mujoco/>"),
    "a class that is not there": ("D269", model().replace("<joint", '<joint class="none"')),
    "an actuator of no joint": ("D269", model(after='<actuator><motor joint="none"/></actuator>')),
    "a keyframe of other joints": ("D269", model(after='<keyframe><key qpos="1 2 3"/></keyframe>')),
    "a control of no actuator": ("D269", model(after='<keyframe><key ctrl="1 2 3"/></keyframe>')),
    "a joint that follows itself": ("D269", model(after='<equality><joint joint1="ja" joint2="ja"/></equality>')),
    "a spring with powers": ("D269", model().replace("<joint", '<joint stiffness="1 2 3"')),
    "two that float": ("D209", "<mujoco><worldbody>" + "".join(
        BODY.format(name=name, more="").replace("<joint", "<freejoint/><body><joint", 1).replace("/> <inertial",
        '/><geom size="1"/></body> <inertial') for name in "ab") + "</worldbody></mujoco>"),
}  # fmt: skip
"""Texts that need MuJoCo, which refuses most of them."""


def refusal(folder: Path, text: str) -> str:
    """The code of the first error. Raises AssertionError where there is none, or it has no place or remedy."""
    (folder / "secret.xml").write_text(ARM, encoding="utf-8")
    here = folder / "model"
    (here / "folder").mkdir(parents=True)
    (here / "linked.xml").symlink_to(folder / "secret.xml")
    (here / "itself.xml").write_text('<mujocoinclude><include file="itself.xml"/></mujocoinclude>', encoding="utf-8")
    (here / "no.xml").write_text("<mujocoinclude>", encoding="utf-8")
    (here / "a.xml").write_text(text, encoding="utf-8")
    with pytest.raises(Problem) as problem:
        import_robot(str(here / "a.xml"))
    for diagnostic in problem.value.diagnostics:
        assert diagnostic.at is not None and diagnostic.help
    assert render(problem.value.diagnostics, problem.value.sources)
    return problem.value.diagnostics[0].code


@pytest.mark.parametrize("what", EARLY)
def test_a_hostile_file_is_refused_before_mujoco_sees_it(what: str, tmp_path: Path) -> None:
    code, text = EARLY[what]
    assert refusal(tmp_path, text) == code


@needs_mujoco
@pytest.mark.slow
@pytest.mark.parametrize("what", LATE)
def test_what_mujoco_refuses_is_told_with_its_words_and_a_place(what: str, tmp_path: Path) -> None:
    code, text = LATE[what]
    assert refusal(tmp_path, text) == code
