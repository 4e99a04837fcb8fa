"""`scripts/benchmark`: takes the figures that are asked for, prints them as a table, and writes them as JSON."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from benchmarks import whole_process
from benchmarks.benchmark import machine, take

SUBJECTS = (whole_process,)
REPEATS = 9


def main() -> int:
    known = {benchmark.name: benchmark for subject in SUBJECTS for benchmark in subject.BENCHMARKS}
    parser = argparse.ArgumentParser(prog="scripts/benchmark", description="Measures MET on this machine.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="benchmarks to take; all by default")
    parser.add_argument("--list", action="store_true", help="list them and stop")
    parser.add_argument("--repeats", type=int, default=REPEATS, metavar="N", help=f"figures of each [{REPEATS}]")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the figures there, as JSON")
    asked = parser.parse_args()
    for name in asked.names:
        if name not in known:
            parser.error(f"no benchmark `{name}`; there are {', '.join(known)}")
    if asked.repeats < 1:
        parser.error("--repeats: at least 1")
    if asked.list:
        for benchmark in known.values():
            print(f"{benchmark.name:12} {benchmark.doc}")
        return 0
    here = machine()
    print(f"{here['processor']}, {here['cores']} cores, {here['system']}, Python {here['python']}, load {here['load']}")
    print(f"median, least and largest of {asked.repeats} after one to warm up")
    figures = []
    for name in asked.names or known:
        figure = take(known[name], asked.repeats)
        figures.append(figure)
        verdict = "met" if figure["met"] else "MISSED"
        target = "" if figure["target"] is None else f"target {figure['target']:g}: {verdict}"
        spread = f"{figure['least']:.3f} to {figure['largest']:.3f}"
        line = f"{name:12} {figure['median']:8.3f} {figure['unit']}  {spread:16} {target:20} {figure['doc']}"
        print(line.rstrip(), flush=True)
    if asked.output is not None:
        asked.output.write_text(json.dumps({"machine": here, "figures": figures}, indent=1) + "\n")
    return 1 if any(figure["met"] is False for figure in figures) else 0


if __name__ == "__main__":
    sys.exit(main())
