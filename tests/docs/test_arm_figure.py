"""The picture of README.md shows the arm that the deck describes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.docs.arm_figure import PICTURE, ROOT, draw


@pytest.mark.slow
def test_the_picture_is_of_the_panda(tmp_path: Path) -> None:
    corners = draw(tmp_path / "panda.png")
    assert (tmp_path / "panda.png").read_bytes().startswith(b"\x89PNG")
    assert f"docs/figures/{PICTURE.name}" in (ROOT / "README.md").read_text(encoding="utf-8")
    # Franka's data sheet: shoulder at 0.333 m, 0.316 m to the elbow, which stands out by 0.0825 m
    lengths = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    sheet = [0.333, 0.0, 0.316, 0.0825, np.hypot(0.0825, 0.384), 0.0, 0.088, 0.107]
    np.testing.assert_allclose(lengths, np.broadcast_to(sheet, lengths.shape), rtol=0.0, atol=1e-12)
    # where Franka's own software has the flange in the ready pose
    assert corners[0, -1] == pytest.approx([0.306891, 0.0, 0.590282], abs=1e-6)
