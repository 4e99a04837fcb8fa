"""FMUs in FMPy, another's master: its checks of the description, and its simulation."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.batch.fmu.arms import NAMES, SHORT, deck, packed, run_rows

pytestmark = [pytest.mark.oracle, pytest.mark.compiler, pytest.mark.slow]


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def file(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    pytest.importorskip("fmpy")
    folder = tmp_path_factory.mktemp("fmpy")
    found = packed(folder, version=request.param)
    if shutil.which("cc") is None:
        pytest.skip("no cc; on Debian or Ubuntu: apt-get install gcc libc6-dev")
    assert found.platform, found.why_none
    (folder / "arm.fmu").write_bytes(found.data)
    return folder / "arm.fmu"


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["tuned", "seeded", "silent"])
def test_the_description_is_valid(tmp_path: Path, name: str, version: int) -> None:
    fmpy = pytest.importorskip("fmpy.validation")
    path = tmp_path / "arm.fmu"
    path.write_bytes(packed(tmp_path, name, version=version).data)
    assert fmpy.validate_fmu(str(path)) == []


def test_the_files_match_the_schemas_of_fmi(file: Path) -> None:
    import zipfile

    import fmpy
    from lxml import etree

    schemas = {"modelDescription.xml": "ModelDescription", "sources/buildDescription.xml": "BuildDescription"}
    with zipfile.ZipFile(file) as archive:
        texts = {name: archive.read(name) for name in schemas if name in archive.namelist()}
    version = 3 if len(texts) == 2 else 2
    for name, text in texts.items():
        path = Path(fmpy.__file__).parent / "schema" / f"fmi{version}" / f"fmi{version}{schemas[name]}.xsd"
        etree.XMLSchema(etree.parse(path)).assertValid(etree.fromstring(text))


@pytest.mark.parametrize("case", range(3))
def test_fmpy_simulates_the_bits_of_a_run(file: Path, case: int) -> None:
    import fmpy

    found = deck(file.parent)
    times, rows, _ = run_rows(found, case)
    names = [channel for each in found.structure.record for channel in each.channels]
    values = {c.path: float(c.values[case]) for c in found.cases.coordinates}
    result = fmpy.simulate_fmu(str(file), start_values=values, output=names, output_interval=0.04)
    assert np.array_equal(np.column_stack([result[name] for name in names]), rows)
    assert np.allclose(result["time"], times, rtol=0.0, atol=1e-12)


def test_inputs_of_fmpy_move_the_arm(file: Path) -> None:
    import fmpy

    steps = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.05), (2.0, 0.05)], dtype=[("time", "f8"), (NAMES[2], "f8")])
    result = fmpy.simulate_fmu(str(file), input=steps, output=["shoulder.qd"], output_interval=0.04)
    rate = dict(zip(result["time"].round(6), result["shoulder.qd"], strict=True))
    assert abs(rate[0.48]) < 1e-3 and rate[2.0] > 0.03


@pytest.mark.parametrize("version", [2, 3])
def test_the_sources_are_built_by_cmake(tmp_path: Path, version: int) -> None:
    import io
    import zipfile

    fmpy = pytest.importorskip("fmpy")
    cmake = Path(sys.executable).parent / "cmake"  # which FMPy brings
    found = packed(tmp_path, "all", SHORT + "run all like brief { }\n", version)  # CMake has a target of this name
    with zipfile.ZipFile(io.BytesIO(found.data)) as archive:
        archive.extractall(tmp_path / "arm")
    (binary,) = (tmp_path / "arm" / "binaries").glob("*/*.so")
    former = fmpy.simulate_fmu(str(tmp_path / "arm"))
    binary.unlink()
    build = tmp_path / "build"
    for words in (["-S", tmp_path / "arm" / "sources", "-B", build], ["--build", build]):
        subprocess.run([cmake, *words], check=True, capture_output=True)
    shutil.copy(build / binary.name, binary)
    assert fmpy.simulate_fmu(str(tmp_path / "arm")).tobytes() == former.tobytes()
