"""Arms with payloads, shown: one that is carried throughout has a frame on its link, and the arm's own stay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.export import export
from tests.batch.export.decks import Mcap
from tests.ic.small_decks import changed
from tests.met.program.free_flyers import ARM
from tests.met.program.payload_decks import BOX, RUN

HELD = "    payload crate { mass = 3 kg;  shape = sphere(radius = 0.1 m);  on = lower;  at = [0.5, 0.1, 0] m; }\n"
RECORD = "record   = [links.lower.position, payloads.crate.position, "


@pytest.mark.release
def test_frames_are_where_the_archive_has_the_links(tmp_path: Path) -> None:
    batch.run(
        ic.compile(text=ARM + changed(RUN, (BOX, BOX + HELD), ("record   = [", RECORD))), output=tmp_path / "deck.h5"
    )
    with batch.open(tmp_path / "deck.h5") as data:
        frames = data.met.frames()
        assert frames.link.values.tolist() == ["base", "upper", "lower"]
        np.testing.assert_allclose(
            frames["position"].sel(link="lower"), data["links.lower.position"], rtol=0, atol=1e-12
        )
        crate = data["payloads.crate.position"].values[0]
        box = data["payloads.box.position"].values[0]
    read = Mcap(export(tmp_path / "deck.h5").path)
    worlds = list(read.worlds("/tf"))
    assert len(worlds) == len(crate)
    for poses, held, flown in zip(worlds, crate, box, strict=True):
        np.testing.assert_allclose(poses["crate"][:3, 3], held, rtol=0, atol=1e-9)
        np.testing.assert_allclose(poses["box"][:3, 3], flown, rtol=0, atol=1e-9)
    (scene,) = (message.data for message in read.of("/scene"))
    told = {entity.id: {each.key: each.value for each in entity.metadata} for entity in scene.entities}
    assert told["crate"] == {"payload": "crate", "mass": "3 kg", "shape": "sphere"}
    assert told["box"] == {"payload": "box", "mass": "12 kg"}


@pytest.mark.release
def test_a_payload_that_flies_and_was_not_recorded_is_not_drawn(tmp_path: Path) -> None:
    batch.run(ic.compile(text=ARM + changed(RUN, ("payloads.box.orientation, ", ""))), output=tmp_path / "deck.h5")
    read = Mcap(export(tmp_path / "deck.h5").path)
    assert set(next(iter(read.worlds("/tf")))) == {"base", "upper", "lower"}
    (scene,) = (message.data for message in read.of("/scene"))
    assert "box" not in {entity.id for entity in scene.entities}
