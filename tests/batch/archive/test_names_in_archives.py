"""Names that decks choose and names that archives have keep apart, in real runs."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
import ic


@pytest.mark.slow
def test_a_joint_called_recorded_and_a_coordinate_do_not_collide(tmp_path: Path) -> None:
    deck = tmp_path / "deck.ic"
    deck.write_text("""
    #include <two_link.ic>
    let q = 0.1 rad;
    arm two {
        link a { mass = 1 kg; shape = sphere(radius = 0.1 m); com = [1, 0, 0] m; }
        joint recorded revolute { parent = base; child = a; axis = z; }
    }
    run loose { arm = two; initial { recorded.q = q; } rates { dynamics = 100 Hz; } duration = 0.1 s;
                record = [recorded.q]; }
    sweep several of loose { vary q = [0.1, 0.2] rad; }
    """)
    archive = batch.run(ic.compile(deck, select=["several"]), output=tmp_path / "a.h5")
    with archive.open() as data:
        assert data["recorded.q"].dims == ("recorded_case", "time")
        assert data["recorded.q"].values[:, 0].tolist() == [0.1, 0.2]
        assert data["q"].values.tolist() == [0.1, 0.2]
