"""How near the shares from any cases come to those from a design made for them, on shipped decks.

    python -m tests.batch.queries.given_data [DECK...]

Six shipped decks vary four parameters each, once in 10,000 random cases and once in 2,048 x 6 of `sample saltelli`. Of
each metric it prints the largest difference of the shares alone and of those with others, each with the widest interval
of the design's. Then come what the estimators for any cases leave to three parameters together, and the number of
parameters whose two intervals of shares with others lie apart. docs/sensitivity.md has the figures.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.sensitivity import Sensitivity, sensitivities

RANDOM, PAIRS = 10_000, 2_048

DECKS = {
    "two_link": ("nominal", """
        gearbox.kp = uniform(0.02, 0.03) V*s/rad;   gearbox.ki = uniform(0.10, 0.15) V/rad;
        gearbox.kt = normal(0.1, 0.003) N*m/A;      links.lower.mass = uniform(15, 40) kg;"""),
    "panda": ("reach", """
        links.load.mass = uniform(0.1, 3) kg;       panda_large.kp = uniform(0.04, 0.07) V*s/rad;
        panda_large.kt = normal(0.1, 0.003) N*m/A;  panda_joint2.f_c = uniform(0.003, 0.006) N*m;"""),
    "puma_560": ("puma_reach", """
        puma_drive.bandwidth = uniform(40, 60) 1/s; links.link2.mass = normal(17.4, 0.5) kg;
        links.link3.mass = normal(4.8, 0.2) kg;     links.link6.mass = uniform(0.09, 2) kg;"""),
    "stanford_arm": ("stanford_sweeping", """
        stanford_drive.bandwidth = uniform(40, 60) 1/s;  links.boom.mass = normal(4.25, 0.2) kg;
        links.head.mass = normal(5.01, 0.2) kg;          links.hand.mass = uniform(0.51, 3) kg;"""),
    "manutec_r3": ("manutec_r3_move", """
        r3_drive.bandwidth = uniform(80, 120) 1/s;  links.load.mass = uniform(1, 15) kg;
        links.link3.mass = normal(26.4, 1) kg;      links.link4.mass = normal(28.7, 1) kg;"""),
    "shuttle_arm": ("shuttle_arm_driven", """
        links.payload.mass = uniform(0, 3000) kg;       shuttle_shoulder.kt = normal(0.25, 0.008) N*m/A;
        shuttle_shoulder.kp = uniform(0.2, 0.3) V*s/rad; links.upper_arm.mass = normal(139.35, 5) kg;"""),
}  # fmt: skip


def found(folder: Path, deck: str, design: str) -> list[Sensitivity]:
    """The sensitivities of a deck's metrics, from a sweep of this design."""
    run, drawn = DECKS[deck]
    rates = "rates { dynamics = 200 Hz; }" if deck == "two_link" else ""  # the paper's own are too slow for some gains
    (folder / f"{deck}.ic").write_text(
        f"#include <{deck}.ic>\nrun brief like {run} {{ {rates} record = []; }}\n"
        f"sweep {design.partition('(')[0]}_cases of brief {{ sample {design} {{ {drawn} }} }}\n"
    )
    plan = ic.compile(folder / f"{deck}.ic", select=[f"{design.partition('(')[0]}_cases"])
    done = batch.run(plan, output=folder / f"{deck}.h5", histories="none", fresh=True)
    with ArchiveFile(done.path) as file:
        return sensitivities(file.groups[0])


def main(decks: list[str]) -> None:
    print(f"{'deck':<14}{'metric':<10}{'alone':>8}{'±':>7}{'with others':>14}{'±':>7}{'rest':>7}{'apart':>7}")
    for deck in decks or DECKS:
        with TemporaryDirectory() as folder:
            given, made = (
                {each.name: each for each in found(Path(folder), deck, design)}
                for design in (f"random({RANDOM})", f"saltelli({PAIRS})")
            )
        for name, one in given.items():
            pairs = list(zip(one.shares, made[name].shares, strict=True))
            if not pairs:
                print(f"{deck:<14}{name:<10}  the same in all cases", flush=True)
                continue
            alone = max(abs(a.first - b.first) for a, b in pairs)
            total = max(abs((a.total or 0.0) - (b.total or 0.0)) for a, b in pairs)
            widths = (max(b.first_by for _, b in pairs), max(0.5 * (b.total_high - b.total_low) for _, b in pairs))
            apart = sum(a.total_low > b.total_high or b.total_low > a.total_high for a, b in pairs)
            print(
                f"{deck:<14}{name:<10}{alone:8.3f}{widths[0]:7.3f}{total:14.3f}{widths[1]:7.3f}{one.rest:7.2f}{apart:7}",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
