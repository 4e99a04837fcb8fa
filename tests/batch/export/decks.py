"""A deck with an arm of every shape and joint, run for tests of exports, and MCAP files read back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import batch
import ic
from met.messages.render import render

DECK = """
let reach = 0.8 m;

arm picker {
    link stand    { mass = 20 kg;   shape = box(size = [0.2, 0.3, 0.4] m, along = z); }
    link carriage { mass = 12 kg;   shape = box(size = [0.3, 0.3, 0.2] m, along = z); }
    link boom     { mass = 5 kg;    shape = cylinder(radius = 40 mm, length = reach, along = x); }
    link wrist    { mass = 1 kg;    com = [0.05, 0, 0.02] m;  inertia = [0.01, 0.01, 0.01] kg*m^2; }
    link pointer  { mass = 0.2 kg;  shape = rod(length = 0.3 m, along = y); }
    link tool     { mass = 0.1 kg;  com = [0, 0, 0.1] m;  inertia = [0.001, 0.001, 0.001] kg*m^2; }
    link plate    { mass = 0.3 kg;  shape = box(size = [0.1, 0.2, 0.05] m); }
    link lamp     { mass = 1.5 kg;  shape = sphere(radius = 60 mm);  com = [0.1, 0, 0] m; }

    joint mount fixed     { parent = base;      child = stand;  at = [0, 0.1, 0] m; }
    joint lift  prismatic { parent = stand;     child = carriage;  axis = z;  at = [0, 0, 0.4] m; }
    joint swing revolute  { parent = carriage;  child = boom;  axis = -y;  at = [0.15, 0, 0.1] m; }
    joint roll  revolute  { parent = boom;      child = wrist;  axis = [1, 2, 2];  at = [reach, 0 m, 0 m];
                            rpy = [20, 30, -40] deg; }
    joint point revolute  { parent = wrist;     child = pointer;  axis = y;  at = [0.1, 0, 0] m; }
    joint hold  fixed     { parent = wrist;     child = tool;  at = [0, 0, 0.2] m;  rpy = [0, 90, 0] deg; }
    joint bolt  fixed     { parent = boom;      child = plate;  at = [0.4, 0, 0] m; }
    joint pan   revolute  { parent = carriage;  child = lamp;  axis = z;   at = [0, 0, 0.2] m; }
}

servo turner { model = ideal;  command = acceleration(sine(amplitude = 2 rad/s^2, frequency = 0.5 Hz)); }
servo lifter { model = ideal;  command = acceleration(0.1 m/s^2); }

default run pick {
    arm         = picker;
    servos      { lift = lifter;  swing = turner;  roll = turner;  point = turner;  pan = turner; }
    initial     { swing.q = -20 deg;  roll.qd = 1 rad/s;  pan.q = 3 rad; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates       { dynamics = 500 Hz;  servos = 500 Hz;  record = 50 Hz; }
    duration    = 1 s;
    record      = [q, qd, tau, swing.servo.command, reaction,
                   links.stand.position, links.carriage.position, links.boom.position, links.wrist.position,
                   links.pointer.position, links.tool.position, links.plate.position, links.lamp.position,
                   links.stand.orientation, links.carriage.orientation, links.boom.orientation,
                   links.wrist.orientation, links.pointer.orientation, links.tool.orientation,
                   links.plate.orientation, links.lamp.orientation];
    metric up   = final { of = lift.q; }
    metric fast = max { of = swing.qd; }
    require up < 1 m;
    require fast < 0.1 rad/s;
}

sweep reaches of pick { vary reach = [0.8, 1.1, 0.5] m; }
sweep sizes of pick {
    vary links.pointer.shape.length = [0.3, 0.4] m;
    zip { links.plate.shape.size.x = [0.1, 0.2] m;  links.boom.shape.radius = [40, 20] mm; }
}
run blind like pick { record = [qd, lift.q]; }
run apart like pick { record = [lift.q, swing.q, roll.q, point.q, pan.q]; }
"""

LINKS = ("stand", "carriage", "boom", "wrist", "pointer", "tool", "plate", "lamp")

CHAIN = """
#ifndef LINKS
#define LINKS 1
#endif
arm chain {
    link first { mass = 4 kg;  shape = rod(length = 0.5 m, along = x); }
    joint one revolute { parent = base;  child = first;  axis = z; }
#if LINKS > 1
    link second { mass = 2 kg;  shape = rod(length = 0.5 m, along = x); }
    joint two revolute { parent = first;  child = second;  axis = z;  at = [0.5, 0, 0] m; }
#endif
}
run swing {
    arm = chain;  initial { one.qd = 3 rpm; }  rates { dynamics = 500 Hz;  record = 50 Hz; }  duration = 0.1 s;
    record = [q, qd];
}
default sweep links of swing { vary macro LINKS = [1, 2];  vary links.first.mass = [4, 5] kg; }
"""


def made(folder: Path, name: str, deck: str = DECK, **options: Any) -> Path:
    """The archive of a run or sweep of a deck."""
    source = folder / "picker.ic"
    source.write_text(deck, encoding="utf-8")
    output = folder / f"picker.{name}.h5"
    batch.run(ic.compile(source, select=[name]), output=output, **options)
    return output


def said(problem: Any) -> str:
    """The whole message, without the count."""
    return render(problem.diagnostics, {})


@dataclass
class Read:
    """A message of an MCAP file, as the official reader gives it."""

    topic: str
    schema: str
    time: int
    data: Any


class Mcap:
    """An MCAP file, read whole by the official reader; every schema in it resolves."""

    def __init__(self, path: Path) -> None:
        from mcap.reader import make_reader
        from mcap_protobuf.decoder import DecoderFactory

        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
            self.library = reader.get_header().library
            self.messages = [
                Read(channel.topic, schema.name, message.log_time, data)
                for schema, channel, message, data in reader.iter_decoded_messages()
            ]
            self.metadata = [(each.name, dict(each.metadata)) for each in reader.iter_metadata()]
            self.attachments = {each.name: each.data.decode() for each in reader.iter_attachments()}
            summary = reader.get_summary()
            self.channels = {channel.topic: channel for channel in summary.channels.values()}
            self.schemas = {schema.id: schema for schema in summary.schemas.values()}

    def of(self, topic: str) -> list[Read]:
        return [message for message in self.messages if message.topic == topic]

    def topics(self) -> set[str]:
        return set(self.channels)

    def entities(self, topic: str) -> dict[str, Any]:
        [update] = self.of(topic)
        return {entity.id: entity for entity in update.data.entities}

    def worlds(self, topic: str) -> Iterator[dict[str, Any]]:
        """At each time, every frame in the world: a 4x4 of its transforms, one after the other."""
        for message in self.of(topic):
            given = {each.child_frame_id: each for each in message.data.transforms}
            yield {name: _in_the_world(name, given) for name in given}


def _in_the_world(name: str, given: dict[str, Any]) -> Any:
    import numpy as np

    out = np.eye(4)
    while name in given:
        each = given[name]
        out = matrix(each.translation, each.rotation) @ out
        name = each.parent_frame_id
    return out


def matrix(p: Any, q: Any) -> Any:
    """The 4x4 of a translation and a unit quaternion, by scipy."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    out = np.eye(4)
    out[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    out[:3, 3] = (p.x, p.y, p.z)
    return out
