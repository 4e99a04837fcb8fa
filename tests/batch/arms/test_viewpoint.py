"""From where a page first shows an arm, by its own script in node."""

from __future__ import annotations

import json
import shutil
import subprocess

import numpy as np
import pytest

from batch.arms.look import FOLDER, look_json

CHOOSE = """
const { readFileSync } = require("fs");
const asked = JSON.parse(readFileSync(0));
globalThis.MET = { look: asked.look };
asked.scripts.forEach((script) => (0, eval)(readFileSync(script, "utf8")));
console.log(JSON.stringify(asked.arms.map((points) => {
  const camera = MET.camera.make();
  camera.choose(points);
  return camera.axes().back;
})));
"""


@pytest.mark.node
def test_a_straight_arm_is_not_looked_along() -> None:
    """Wherever it points, level or bent by a little in an upright plane."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node; on Debian or Ubuntu: apt-get install nodejs")
    angles = np.radians(np.arange(0.0, 360.0, 10.0))
    ways = [np.array([np.cos(a), np.sin(a), 0.0]) for a in angles]
    arms = [
        [(s * way + [0.0, 0.0, bend * s * s]).tolist() for s in (0.0, 0.5, 1.0)] for way in ways for bend in (0, 0.05)
    ]
    asked = {"look": look_json(), "scripts": [str(FOLDER / each) for each in ("arm.js", "camera.js")], "arms": arms}
    done = subprocess.run([node, "-e", CHOOSE], input=json.dumps(asked), capture_output=True, text=True, check=True)
    backs = np.array(json.loads(done.stdout))[:, :2]
    along = np.abs(np.einsum("ki,ki->k", backs, np.repeat(ways, 2, axis=0)[:, :2])) / np.linalg.norm(backs, axis=1)
    assert np.degrees(np.arccos(along.max())) > 30.0
