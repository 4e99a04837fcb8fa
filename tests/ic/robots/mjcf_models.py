"""Models in MJCF with all that is read of it, and what MuJoCo 4.0.0 made of them, for tests without MuJoCo.

`python -m tests.ic.robots.mjcf_models` writes mjcf_recorded.json again, with the MuJoCo that is installed.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

import pytest

from ic.robots import mjcf
from ic.robots.mjcf_xml import MjcfSource, source_of
from ic.robots.xml import parse
from ic.text.files import Files

Test = TypeVar("Test", bound=Callable[..., object])
RECORDED = Path(__file__).with_name("mjcf_recorded.json")


def needs_mujoco(test: Test) -> Test:
    """Mark a test that asks MuJoCo, which no lock names, so that it runs with `scripts/test --all` alone."""
    missing = pytest.mark.skipif(find_spec("mujoco") is None, reason="MuJoCo is not installed: pip install mujoco")
    return pytest.mark.release(missing(test))


ARM = """\
<mujoco model="pick-up">
  <compiler angle="degree" meshdir="shapes"/>
  <option gravity="0 0 -9.8" timestep="0.002"/>
  <default>
    <joint armature="0.01" damping="0.5"/>
    <default class="small"> <joint armature="0"/> <geom density="500" material="grey"/> </default>
  </default>
  <asset> <material name="grey"/> <mesh name="cover" file="cover.stl"/> </asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="plane" size="1 1 0.1"/>
    <body name="stand" pos="0 0 0.3">
      <geom type="cylinder" size="0.1 0.15" mass="7"/>
      <body name="upper" pos="0 0 0.15" quat="1 0 1 0">
        <joint name="shoulder" axis="0 1 0" range="-90 60" frictionloss="0.2" ref="30"/>
        <inertial pos="0.2 0 0" mass="3" fullinertia="0.01 0.05 0.05 0.001 0 0"/>
        <geom type="mesh" mesh="cover"/>
        <body name="wrist" pos="0.4 0 0" euler="0 30 0">
          <joint name="roll" axis="1 0 0" pos="0.1 0 0"/>
          <joint name="yaw" axis="0 1 1" pos="0.1 0 0.02" stiffness="3" springref="20" solreflimit="0.01 1"/>
          <geom type="capsule" size="0.03" fromto="0 0 0 0.2 0 0"/>
          <body childclass="small" pos="0.25 0.02 0">
            <joint name="left" type="slide" axis="0 1 0" range="0 0.04"/> <geom type="box" size="0.01 0.02 0.03"/>
          </body>
          <frame pos="0.25 -0.02 0">
            <body name="right finger" childclass="small">
              <joint name="right" type="slide" axis="0 1 0" ref="0.01"/> <geom type="box" size="0.01 0.02 0.03"/>
              <site name="pad"/>
            </body>
          </frame>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <joint joint1="right" joint2="left" polycoef="-0.01 -1 0 0 0"/>
    <connect body1="upper" body2="wrist" anchor="0 0 0" active="false"/>
  </equality>
  <tendon> <fixed name="split"> <joint joint="left" coef="0.5"/> <joint joint="right" coef="-0.5"/> </fixed> </tendon>
  <actuator>
    <position name="hold" joint="shoulder" kp="200" kv="20" ctrlrange="-1 1" forcerange="-50 40"/>
    <motor joint="roll" gear="5" ctrlrange="-2 2"/>
    <general name="close" tendon="split" gainprm="10"/>
    <velocity joint="yaw" kv="4"/>
    <general joint="left" gaintype="fixed" biastype="affine" gainprm="100" biasprm="0 -100 -1" gear="2"/>
  </actuator>
  <sensor> <jointpos joint="roll"/> <jointpos joint="yaw"/> </sensor>
  <keyframe>
    <key name="bent" qpos="0.5 0 0 0 0"/>
    <key name="home" qpos="-0.4 0.1 0.2 0.02 -0.02" ctrl="-0.3 0 1 0 0.02"/>
  </keyframe>
</mujoco>
"""
FLOATING = """\
<mujoco>
  <option> <flag gravity="disable"/> </option>
  <worldbody>
    <body name="wall" pos="5 0 0"> <geom size="1"/> </body>
    <body name="satellite" pos="1 2 3" euler="0 0 90">
      <freejoint/>
      <geom type="box" size="0.5 0.4 0.3" mass="40"/>
      <body name="boom" pos="0.5 0 0">
        <joint axis="0 1 1" stiffness="20" springref="30" damping="2"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 1 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
SCENE = """\
<mujoco model="m">
  <worldbody>
    <body name="cube" pos="1 0 0"> <freejoint name="cube"/> <geom type="box" size="0.1 0.1 0.1"/> </body>
    <body name="a">
      <geom size="0.1"/>
      <body name="b">
        <joint name="a_mount"/> <joint name="a" axis="1 0 0"/> <geom size="0.1" pos="0.3 0 0"/>
        <body name="b_on_a_mount" pos="0.5 0 0"> <geom size="0.1"/> </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <general joint="a" dyntype="filter" dynprm="0.1" gainprm="5"/>
    <motor joint="a_mount" gear="-3" ctrlrange="-1 2"/>
    <motor site="pad"/>
  </actuator>
  <keyframe> <key qpos="0 0 0 1 0 0 0 0.1 0.2" ctrl="0 1 0"/> </keyframe>
</mujoco>
"""
LOOKS = """\
<mujoco>
  <compiler angle="degree" meshdir="shapes"/>
  <default>
    <mesh scale="2 2 2"/>
    <default class="seen"> <geom type="mesh" group="2" contype="0"/> <mesh scale="0.001 0.001 0.001"/> </default>
    <default class="felt"> <geom group="3"/> </default>
  </default>
  <asset>
    <mesh class="seen" file="cover.stl"/>
    <mesh name="big" file="cover.stl"/>
    <mesh name="other" file="cover.dae" scale="1 1 1"/>
    <mesh name="lost" file="lost.stl"/>
  </asset>
  <worldbody>
    <body name="upper" childclass="seen">
      <joint name="turn" pos="0.1 0 0" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <geom mesh="cover" pos="0.2 0 0" euler="90 0 0"/>
      <geom type="mesh" mesh="big" class="felt"/>
      <geom mesh="other"/>
      <geom mesh="lost"/>
      <frame pos="0 0 1" euler="0 0 90"> <geom mesh="big" pos="1 0 0"/> </frame>
    </body>
  </worldbody>
</mujoco>
"""
MODELS = {"arm": ARM, "floating": FLOATING, "scene": SCENE, "looks": LOOKS}


def tetrahedron() -> bytes:
    """A mesh as an STL file."""
    corners = ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    triangles = (struct.pack("<12fH", 0, 0, 0, *(x for corner in face for x in corners[corner]), 0) for face in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + b"".join(triangles)


def source(text: str, path: str = "arm.xml") -> MjcfSource:
    return source_of(parse(path, text), path, Files())


def play(patch: pytest.MonkeyPatch) -> None:
    """Let what was recorded stand for MuJoCo."""
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))
    by_text = {source(text).text: recorded[name] for name, text in MODELS.items()}

    def compiled(given: MjcfSource, place: object) -> Any:
        return json.loads(json.dumps(by_text[given.text]))

    patch.setattr(mjcf, "compiled", compiled)


def record() -> dict[str, Any]:
    return {name: mjcf.compiled(source(text), parse("arm.xml", text).place) for name, text in MODELS.items()}


if __name__ == "__main__":
    RECORDED.write_text(json.dumps(record(), indent=1) + "\n", encoding="utf-8")
