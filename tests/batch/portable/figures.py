"""Pictures of docs/webassembly.md and README.md: the page of a real sweep, as a browser shows it.

python -m tests.batch.portable.figures          writes docs/figures/view_*.png

view_arm.png      the Panda with an upper arm of seven lengths, one of them solid
view_narrow.png   the same page on a telephone, dark
view_acting.png   all that acts on it: joint forces, loads, a stop, the gas of a thruster, a payload
view_film.png     six instants, as the page prints them
view_beside.png   the arm with the forces of its joints, beside a log of which one joint lags

It says how large the page is, and how long its pictures take.
"""

from __future__ import annotations

import base64
import tempfile
from pathlib import Path

import numpy as np

import batch
import ic
from met import cli
from tests.batch.report.browser import Chromium, Page, browser

FOLDER = Path(__file__).parents[3] / "docs" / "figures"

UPPER = "#include <panda.ic>\nsweep upper of reach { vary d3 = linspace(0.2, 0.45, 7) m; }\n"
HUNDRED = "#include <panda.ic>\nsweep hundred of reach { vary links.load.mass = linspace(0.1, 3, 101) kg; }\n"

FORCES = "#include <panda.ic>\nrun forces like reach { record += [reaction.force]; }\n"

ACTING = """#include <panda.ic>
run acted like reach {
    environment {
        push = wrench { link = link4;  force = [0, 40, 0] N;  from = 0.5 s; }
        turn = wrench { link = link6;  moment = [0, 0, 4] N*m;  from = 0.5 s; }
        jet  = plume { link = link7;  at = [0, 0, 0.2] m;  width = 0.3 m;  height = 0.3 m;  cells = 2;  sides = both;
                       nozzle = [0.9, -0.1, 0.9] m;  axis = [-0.4, 0.6, -0.3];  thrust = 10 N;  exponent = 10; }
        stop = joint_stop { joint = joint4;  upper = -95 deg;  stiffness = 100 N*m/rad; }
    }
    payload parcel { mass = 0.5 kg;  shape = box(size = [0.12, 0.12, 0.12] m);  on = load;  at = [0, 0, 0.1] m;
                     release = 4.95 s; }
    record += [reaction.force, payloads.parcel.position, payloads.parcel.orientation];
}
"""

READY = """new Promise(done => { const ready = () => document.documentElement.dataset.haunted && MET.shown.isStill() &&
    MET.shown.legend.looked(); const look = () => ready() ? done() : setTimeout(look, 30); look(); })"""


CHOOSE = """(() => { const chosen = document.querySelector(".knob select"); chosen.value = 3;
    chosen.dispatchEvent(new Event("change")); })()"""


def draw(folder: Path) -> list[Path]:
    """All pictures, in `folder`; gives back their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, browser() as chromium:
        home = Path(name)
        (home / "upper.ic").write_text(UPPER, encoding="utf-8")
        batch.run(ic.compile(home / "upper.ic", select=["upper"]), output=home / "panda.h5")
        page = _page(home / "panda.h5")
        shown = chromium.open(page, width=1180, height=900, scale=1.5)
        shown.run(CHOOSE)
        written = [_at(shown, 2.0).picture(folder / "view_arm.png", ".stage")]
        shown.run("dispatchEvent(new Event('beforeprint')); document.querySelector('.film').style.display = 'grid'; 0")
        written.append(shown.picture(folder / "view_film.png", ".film", margin=0))
        narrow = _at(chromium.open(page, width=390, height=844, dark=True, scale=2), 2.0)
        picture = narrow.ask("Page.captureScreenshot", format="png")["data"]
        written.append(folder / "view_narrow.png")
        written[-1].write_bytes(base64.b64decode(picture))

        written.append(beside(chromium, home, folder))

        (home / "acting.ic").write_text(ACTING, encoding="utf-8")
        batch.run(ic.compile(home / "acting.ic", select=["acted"]), output=home / "acting.h5")
        shown = chromium.open(_page(home / "acting.h5"), width=1180, scale=1.5)
        written.append(_at(shown, 4.0).picture(folder / "view_acting.png", ".stage"))

        (home / "hundred.ic").write_text(HUNDRED, encoding="utf-8")
        batch.run(ic.compile(home / "hundred.ic", select=["hundred"]), output=home / "hundred.h5", histories="none")
        for width in (1280, 400):
            crowd = _at(chromium.open(_page(home / "hundred.h5"), width=width), 2.0)
            times = [crowd.run("MET.shown.measure(10)") for _ in range(3)]
            print(f"{crowd.run('MET.shown.ghosts()')} ghosts, {width} px: {min(times):.0f} ms a picture")
    return written


def beside(chromium: Chromium, home: Path, folder: Path) -> Path:
    """The picture of a run beside a log that is made of it: its joint 2 is 0.3 s late."""
    (home / "forces.ic").write_text(FORCES, encoding="utf-8")
    batch.run(ic.compile(home / "forces.ic", select=["forces"]), output=home / "forces.h5")
    with batch.open(home / "forces.h5") as data:
        time, joints, q = data["time"].values, data["joint"].values.tolist(), data["q"].values.reshape(-1, 7)
    late = np.stack(
        [np.interp(time - 0.3 * (name == "joint2"), time, q[:, n]) for n, name in enumerate(joints)], axis=1
    )
    rows = ["time [s], " + ", ".join(f"{name}.q [rad]" for name in joints)]
    rows += [", ".join(f"{x:.6g}" for x in (t, *row)) for t, row in zip(time, late, strict=True)]
    (home / "bench.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    shown = chromium.open(_page(home / "forces.h5", "--against", str(home / "bench.csv")), width=1180, scale=1.5)
    return _at(shown, 1.2).picture(folder / "view_beside.png", ".stage")


def _page(archive: Path, *words: str) -> Path:
    assert cli.main(["view", str(archive), "-q", *words]) == 0
    page = archive.with_suffix(".view.html")
    print(f"{page.name}: {page.stat().st_size / 1024:.0f} KiB")
    return page


def _at(page: Page, time: float) -> Page:
    page.run(READY)
    page.run(f"MET.shown.seek({time})")
    page.run(READY)
    page.settle()
    return page


if __name__ == "__main__":
    for path in draw(FOLDER):
        print(path)
