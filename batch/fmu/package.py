"""An FMU as a file: the C sources, a binary for this platform where there is a compiler, and the archive of both."""

from __future__ import annotations

import hashlib
import io
import platform
import re
import shutil
import subprocess
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path

from batch.fmu.variables import TOOL, FmuVariable, Naming, build_description, changing, model_description, variables
from met.backends.c.emit import CSource, emit, literal
from met.backends.c.library import FLAGS
from met.frozen import frozen
from met.host.files import open_regular
from met.plan import Experiment
from met.program import plausible
from met.program.build import UNHELD, build
from met.program.step import FAILURE
from met.trace.program import Recording, RecordSection, RunSection
from met.trace.recorder import record
from met.version import VERSION

DESCRIPTION = "modelDescription.xml"

ASSETS = Path(__file__).parent / "assets"

LIBRARY = ("-std=c11", "-ffp-contract=off")
"""Options that any build of the sources needs."""

ENDINGS = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib")}
"""The name of a system in FMI's platforms, and the ending of its shared libraries, by its name in Python."""

FORMER = {"x86_64-linux": "linux64", "x86_64-darwin": "darwin64", "aarch64-darwin": "darwin64"}
"""The names of platforms in FMI 2.0, by those in FMI 3.0, where they differ."""

MACHINES = {"x86_64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
"""The name of a processor in FMI's platforms, by its name in Python."""

CMAKE = """\
cmake_minimum_required(VERSION 3.16)
project(fmu C)
add_library(fmu SHARED fmi{version}.c)
set_target_properties(fmu PROPERTIES OUTPUT_NAME {identifier} PREFIX "" C_STANDARD 11 C_EXTENSIONS OFF
  C_VISIBILITY_PRESET hidden)
if(NOT MSVC)
  target_compile_options(fmu PRIVATE -ffp-contract=off)
endif()
"""

NOTICE = f"""\
In the folder `sources`, the file fmi2.c or fmi3.c, fmu.h and CMakeLists.txt, and in model.h the functions before
`met_case`, are part of MET {VERSION}. You may use them under the Apache License, Version 2.0:
https://www.apache.org/licenses/LICENSE-2.0. They come without warranty of any kind.

All else in this FMU was made from a deck and from the files that it reads. MET's licence does not apply to it: it is
for the author of the deck to say how it may be used.
"""

PAGE = """\
<!DOCTYPE html>
<html><head><meta charset="utf-8"><title>{identifier}</title></head>
<body><p>This FMU was made by MET {version}. modelDescription.xml describes its variables and its steps. To build a
binary for another platform, run <code>cmake -S sources -B build</code> and <code>cmake --build build</code>.</p></body>
</html>
"""


@frozen
class Fmu:
    """An FMU in memory.

    variables  in the order of their value references
    platform   of the binary, as FMI names it; "" where there is none
    why_none   the reason then
    """

    data: bytes
    variables: tuple[FmuVariable, ...]
    platform: str
    why_none: str


def fmu_of(experiment: Experiment, version: int = 3) -> Fmu:
    """The FMU of an experiment's first case. version: of FMI, 2 or 3"""
    listed = variables(experiment)
    text = _model(emit(_recording(experiment)), listed, experiment.structure.schedule.base_hz)
    identifier = re.sub(r"\W", "_", experiment.name, flags=re.ASCII)
    identifier = identifier if identifier[:1].isalpha() else f"met_{identifier}"
    naming = Naming(experiment.name, identifier, hashlib.sha256(text.encode()).hexdigest()[:32])
    sources = {
        "model.h": f'#define MODEL_TOKEN "{naming.token}"\n{text}',
        **{name: (ASSETS / name).read_text(encoding="utf-8") for name in ("fmu.h", f"fmi{version}.c")},
    }
    files = {
        DESCRIPTION: model_description(experiment, listed, naming, version),
        "documentation/index.html": PAGE.format(identifier=identifier, version=VERSION),
        "documentation/licenses/license.txt": NOTICE,
        **({"sources/buildDescription.xml": build_description(naming, LIBRARY)} if version == 3 else {}),
        "sources/CMakeLists.txt": CMAKE.format(identifier=identifier, version=version),
        **{f"sources/{name}": source for name, source in sources.items()},
    }
    packed = {name: source.encode() for name, source in files.items()}
    system, ending = ENDINGS.get(platform.system(), ("", ""))
    machine = MACHINES.get(platform.machine(), "")
    known = bool(system and machine)
    binary, why = _binary(sources) if known else (b"", "MET does not know FMI's name of this platform")
    name = f"{machine}-{system}" if version == 3 else FORMER.get(f"{machine}-{system}", f"{machine}-{system}")
    if binary:
        packed[f"binaries/{name}/{identifier}{ending}"] = binary
    return Fmu(_zipped(packed), listed, name if binary else "", why)


def is_fmu(path: Path) -> bool:
    """True for an FMU that MET wrote: its description comes first, and is not compressed."""
    with open_regular(path) as file:
        return f'generationTool="{TOOL}'.encode() in file.read(2000)


def _recording(experiment: Experiment) -> Recording:
    """The program of an experiment in which coordinates may change, and rows are recorded at its end: where a master
    reads outputs, at any tick."""
    recording = record(build(experiment, changing=changing(experiment)))
    rows = [RunSection(node.section) for node in recording.tick if isinstance(node, RecordSection)]
    tick = tuple(node for node in recording.tick if not isinstance(node, RecordSection))
    return replace(recording, tick=tick, end=(*rows, *recording.end))


def _model(source: CSource, listed: tuple[FmuVariable, ...], base_hz: float) -> str:
    """The text of model.h but for its token: the program, and the table of variables."""
    members = {**source.outputs, **source.inputs}
    alarms = [members[name] for name in (FAILURE[0], plausible.FAILED_TICK, UNHELD) if name in source.outputs]
    rows = []
    for variable in listed:
        source_name = variable.source
        place = f"row[{source_name}]" if isinstance(source_name, int) else members[source_name]
        kind = "OUTPUT" if variable.start is None else variable.kind.upper()
        numbers = ", ".join(_number(x) for x in (variable.start or 0.0, variable.low, variable.high))
        rows.append(
            f'    {{"{variable.name}", offsetof(met_case, {place}), {kind}, {int(variable.whole)}, {numbers}}},\n'
        )
    return (
        f"/* The program of one run. Written by MET {VERSION}. */\n\n{source.text}\n"
        "#include <stddef.h>\n\n"
        f"#define MODEL_BASE_HZ {literal(base_hz)}\n\n"
        "/* By value reference; the first is time. */\n"
        "typedef struct {\n    const char *name;\n    size_t place;\n    enum { PARAMETER, INPUT, OUTPUT } kind;\n"
        "    int whole;\n    double start, min, max;\n} met_variable;\n\n"
        'static const met_variable met_variables[] = {\n    {"time", 0, OUTPUT, 0, 0.0, 0.0, 0.0},\n'
        f"{''.join(rows)}}};\n\n"
        "/* Outputs that are not 0 once the case has failed. */\n"
        f"static const size_t met_alarms[] = {{{', '.join(f'offsetof(met_case, {name})' for name in alarms)}}};\n"
    )


def _number(x: float) -> str:
    """A double in C, where one that is not finite is the largest there is."""
    return literal(x) if abs(x) <= 1.7e308 else "-DBL_MAX" if x < 0.0 else "DBL_MAX"


def _binary(sources: dict[str, str]) -> tuple[bytes, str]:
    """The shared library of the sources, or nothing and the reason."""
    compiler = shutil.which("cc")
    if compiler is None:
        return b"", "there is no C compiler `cc` here"
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        main = next(name for name in sources if name.endswith(".c"))
        command = [compiler, *FLAGS, "-fvisibility=hidden", "-o", "fmu.so", main]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return b"", f"`cc` refuses the sources: {(done.stderr.splitlines() or [''])[0]}"
        return (Path(folder) / "fmu.so").read_bytes(), ""


def _zipped(files: dict[str, bytes]) -> bytes:
    """An archive of files, the same bytes each time."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name)
            info.compress_type = zipfile.ZIP_STORED if name == DESCRIPTION else zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, content)
    return data.getvalue()
