"""What the firmware is built with: counts of a config, compilers, the cache, and what is said where one is missing."""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hw.bed import Capability
from hw.boards import build as building
from hw.boards.build import Config, build, config_c, counted, guard, qemu
from hw.drivers import opened
from hw.ports import Port
from met.diagnostic import Problem
from met.host import cache
from met.messages.render import render
from tests.hw.firmware.device import PLAIN, SHAFT, Sensors
from tests.hw.firmware.line import FREE, PLANT, STEPPED, behind_a_terminal
from tests.substitution.hybrid import compiled, deck


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "firmware"


# Counts


def test_limits_are_counted_down_and_told_as_counted() -> None:
    odd = replace(PLAIN, limits=replace(PLAIN.limits, voltage=20.009, rate=349.99, voltage_slew=3999.0), deadman=0.0159)
    counts, told, deadman = counted(odd)
    assert (counts["voltage"], counts["rate"], counts["voltage_slew"], counts["deadman"]) == (2000, 3499, 399, 15)
    assert (told.voltage, told.voltage_slew, deadman) == (20.0, 3990.0, 0.015)
    assert told.rate == 3499 * 0.1


def test_a_limit_that_is_a_whole_count_loses_none() -> None:
    for scale in (0.1, 0.3, 1e-3, 40 / 4096, 1 / 3):
        for count in (1, 7, 2047, 10**6):
            odd = replace(
                PLAIN,
                scales=replace(PLAIN.scales, rate=scale),
                limits=replace(PLAIN.limits, rate=count * scale, arming_rate=scale),
            )
            assert counted(odd)[0]["rate"] == count


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"deadman": 0.0095}, "a deadman of 0.009 s, in whole ticks, is not 0.010 to 0.020 s"),
        ({"deadman": 0.0211}, "a deadman of 0.021 s, in whole ticks, is not 0.010 to 0.020 s"),
        ({"tick_hz": 0.0}, "tick rate is 0, not a number above 0"),
        ({"tick_hz": math.nan}, "tick rate is nan, not a number above 0"),
        ({"scales": replace(PLAIN.scales, rate=-1.0)}, "scale of rate is -1, not a number above 0"),
        ({"limits": replace(PLAIN.limits, heat=math.inf)}, "limit of heat is inf, not a number above 0"),
        ({"limits": replace(PLAIN.limits, voltage_slew=9.0)}, "voltage slew is 0 counts, not 1 to 2147483646"),
        ({"scales": replace(PLAIN.scales, voltage=1e-9)}, "voltage is 2e+10 counts, not 1 to 2147483646"),
        ({"limits": replace(PLAIN.limits, heat=1e12)}, "the current's scale is too fine for the I2t of the load"),
        ({"trip": math.inf}, "load trip is 4.611686018e+18 counts, not 1 to 2147483646"),
        ({"scales": replace(PLAIN.scales, voltage=5e-324)}, "voltage is 4.611686018e+18 counts, not 1 to 2147483646"),
        (
            {"shaft": replace(SHAFT, inertia=1e-18)},
            "the scales are too fine, or the shaft too light, for the tachometer's guard",
        ),
        ({"shaft": replace(SHAFT, f_cut=1e-8)}, "the tachometer's filter is too slow for its guard"),
        ({"shaft": replace(SHAFT, f_cut=0.0)}, "the shaft's f_cut is 0, not a number above 0"),
        ({"shaft": replace(SHAFT, f_c=-0.01)}, "the shaft's f_c is -0.01, not a number above 0"),
        ({"shaft": replace(SHAFT, kt=math.nan)}, "the shaft's kt is nan, not a number above 0"),
        ({"name": ""}, "the name '' is not 1 to 16 printable characters of ASCII"),
        ({"name": "a bed for us all!"}, "the name 'a bed for us all!' is not 1 to 16 printable characters of ASCII"),
        ({"name": "b\0"}, "the name 'b\\x00' is not 1 to 16 printable characters of ASCII"),
        ({"name": "caf\xe9"}, "the name 'caf\xe9' is not 1 to 16 printable characters of ASCII"),
    ],
)
def test_what_cannot_be_counted_is_said(change: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError) as found:
        config_c(replace(PLAIN, **change), plant=False)  # type: ignore[arg-type]
    assert str(found.value) == said


@pytest.mark.compiler
@pytest.mark.parametrize(
    ("bed", "reason", "remedy"),
    [
        ("converter_in = 6 rad/s", "arming rate is 0 counts, not 1 to 2147483646", "a smaller `converter_in`"),
        ("converter_current = 10 A", "current is 0 counts, not 1 to 2147483646", "a smaller `converter_current`"),
        ("i_max = 1e6 A", "current is 1.048576e+12 counts, not 1 to 2147483646", "a larger `converter_current`"),
        ("i_max = 100 A", "the current's scale is too fine for the I2t of the load", "a larger `converter_current`"),
        (
            "inertia = 1e-18 kg*m^2",
            "the scales are too fine, or the shaft too light, for the tachometer's guard",
            "a larger `inertia` or `converter_in`",
        ),
        (
            "inertia = 1e-320 kg*m^2",
            "the scales are too fine, or the shaft too light, for the tachometer's guard",
            "a larger `inertia` or `converter_in`",
        ),
        ("f_cut = 1e-8 Hz", "the tachometer's filter is too slow for its guard", "a larger `f_cut`"),
        ("i_max = 1e200 A", "limit of heat is inf, not a number above 0", "numbers of a size that a bed may have"),
    ],
)
def test_a_deck_s_bed_that_firmware_cannot_count_is_said(bed: str, reason: str, remedy: str) -> None:
    experiment = compiled(deck(bed=f"emulated({bed})"), "on_bench")
    with pytest.raises(Problem) as found:
        opened(Port("firmware"), experiment, "shoulder", 0, 1e-3)
    assert render(found.value.diagnostics, {}) == (
        f"error[E404]: the bed of joint `shoulder` cannot be one of firmware: {reason}\n"
        f" = help: give the deck's bed {remedy}\n"
        " = help: `--port emulated` has it as it is\n\n"
        "1 error\n"
    )


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize("bed", ["", "inertia = 1e-9 kg*m^2", "tau_max = 1e9 N*m", "f_c = 0 N*m, f_v = 0 N*m*s/rad"])
def test_a_deck_s_bed_is_counted_however_light_and_free(bed: str) -> None:
    experiment = compiled(deck(bed=f"emulated({bed})"), "on_bench")
    opened(Port("firmware"), experiment, "shoulder", 0, 1e-3)


def test_the_guard_has_as_many_bits_as_there_is_room_for() -> None:
    assert guard(replace(PLAIN, shaft=SHAFT))["bits"] == 24
    light = [guard(replace(PLAIN, shaft=replace(SHAFT, inertia=10.0**-n))) for n in range(8, 16)]
    assert [each["bits"] for each in light] == sorted((each["bits"] for each in light), reverse=True)
    for each in light:
        counts = counted(PLAIN)[0]
        sure = each["most"] + each["current"] * counts["current"] + each["viscous"] * counts["rate"]
        largest = max(256 * each["most"], 256 * each["current"] * counts["current"], sure * (each["lag"] + 1))
        assert largest < 2**60 and (each["bits"] == 24 or largest >= 2**56)


@pytest.mark.compiler
def test_a_tick_is_the_plant_s_period() -> None:
    for kind in ("host", "library", "arm"):
        with pytest.raises(ValueError, match=r"^a tick of 500 Hz is not the plant's period, 0\.001 s$"):
            build(kind, replace(FREE, tick_hz=500.0), PLANT)
    with pytest.raises(ValueError, match=r"^a tick of 1000 Hz is not the plant's period, 0\.002 s$"):
        build("host", FREE, PLANT.replace("#define PERIOD 0.001", "#define PERIOD 0.002"))
    with pytest.raises(ValueError, match=r"^plant\.c does not say its `plant_period` as a number$"):
        build("host", FREE, PLANT.replace("plant_period = PERIOD", "plant_period = 1.0 / RATE"))
    odd = 1.0 / 7.0e2
    for text in (repr(odd), odd.hex()):
        build("library", replace(FREE, tick_hz=700.0), PLANT.replace("plant_period = PERIOD", f"plant_period = {text}"))


def test_lock_step_is_for_simulated_plants() -> None:
    with pytest.raises(ValueError, match=r"^lock-step is for simulated plants$"):
        config_c(replace(PLAIN, capabilities=Capability.LOCK_STEP), plant=False)
    with pytest.raises(ValueError, match=r"^firmware of kind 'host' needs a plant$"):
        build("host", PLAIN)


def test_the_guard_s_numbers_are_those_of_the_shaft() -> None:
    g, one = guard(replace(PLAIN, shaft=SHAFT)), 2.0**24
    rate = 0.1  # rad/s a count
    assert g["voltage"] / one * rate == pytest.approx(0.061 / 2.05 * 0.01 / 6.38e-5 * 1e-3, rel=1e-5)
    assert g["current"] / one * rate == pytest.approx(0.072 * 0.002 / 6.38e-5 * 1e-3, rel=1e-5)
    assert g["most"] / one * rate == pytest.approx(0.144 / 6.38e-5 * 1e-3, rel=1e-5)
    assert g["back_emf"] / one == pytest.approx(0.061**2 / 2.05 / 6.38e-5 * 1e-3, rel=1e-5)
    assert g["viscous"] / one == pytest.approx(2.58e-5 / 6.38e-5 * 1e-3, rel=1e-4)
    assert g["friction"] / one * rate == pytest.approx(2 * 0.0205 / 6.38e-5 * 1e-3, rel=1e-5)
    assert (g["tolerance"], g["change"], g["lag"]) == (64, 35, 14)
    assert set(guard(PLAIN).values()) == {0}


# The cache


@pytest.mark.compiler
def test_what_was_built_is_there_the_next_time(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = build("library", FREE, PLANT)
    made = first.stat().st_mtime_ns
    monkeypatch.setattr(building, "_compile", None)
    again = build("library", FREE, PLANT)
    assert again == first and again.stat().st_mtime_ns == made
    assert [path.name for path in fresh.iterdir()] == [first.parent.name]
    assert sorted(path.name for path in first.parent.iterdir()) == ["config.c", "libbed.so", "plant.c", "sum"]


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def others_may_write_it(path: Path) -> None:
    path.chmod(0o722)


def others_may_write_its_folder(path: Path) -> None:
    path.parent.chmod(0o777)


def of_another_name(path: Path) -> None:
    other = path.parent.with_name("0" * 32)
    path.parent.rename(other)
    shutil.copytree(other, path.parent)
    (path.parent / "sum").write_bytes(cache.digest_of("another", path.read_bytes()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "spoil", [emptied, cut, Path.unlink, others_may_write_it, others_may_write_its_folder, of_another_name]
)
def test_what_is_not_as_it_was_built_is_built_anew(
    fresh: Path, spoil: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = build("library", FREE, PLANT)
    built = first.read_bytes()
    spoil(first)
    compiled_anew, compile_once = [], building._compile
    monkeypatch.setattr(building, "_compile", lambda *words: compiled_anew.append(1) or compile_once(*words))
    again = build("library", FREE, PLANT)
    assert again == first and again.read_bytes() == built and compiled_anew == [1]
    assert again.stat().st_mode & 0o077 == again.parent.stat().st_mode & 0o077 == 0
    assert not list(fresh.glob(".*"))


@pytest.mark.release
@pytest.mark.compiler
def test_another_config_plant_kind_or_flag_is_another_build(fresh: Path) -> None:
    paths = {
        build("library", FREE, PLANT),
        build("library", replace(FREE, name="another"), PLANT),
        build("library", FREE, PLANT + "\n"),
        build("library", FREE, PLANT, flags=("-g",)),
        build("host", FREE, PLANT),
    }
    assert len(paths) == 5


@pytest.mark.release
@pytest.mark.compiler
def test_the_firmware_of_hello_is_that_of_sources_config_and_plant(fresh: Path) -> None:
    def told(config: Config, plant: str) -> bytes:
        with behind_a_terminal(config, plant=plant) as (line, _):
            return line.greet().firmware

    assert told(STEPPED, PLANT) == told(STEPPED, PLANT)
    assert len({told(STEPPED, PLANT), told(STEPPED, PLANT + "\n"), told(replace(STEPPED, trip=1.2), PLANT)}) == 3


@pytest.mark.parametrize("length", range(1, 17))
def test_a_bed_is_called_what_its_config_says(length: int) -> None:
    name = "bench 1 of twelve"[:length]
    text = config_c(replace(FREE, name=name), plant=True, firmware=bytes(range(0xF1, 0xF9)))
    [firmware], [told] = (re.findall(rf"\.{field} = {{(.*?)}},", text) for field in ("firmware", "name"))
    assert bytes(int(each, 16) for each in firmware.split(", ")) == bytes(range(0xF1, 0xF9))
    assert bytes(int(each, 16) for each in told.split(", ")) == name.encode().ljust(16, b"\0")


@pytest.mark.compiler
@pytest.mark.parametrize("name", ["b", "bench 1", "bench 12"])
def test_a_bed_of_a_short_name_tells_name_and_firmware(name: str) -> None:
    with behind_a_terminal(replace(FREE, name=name)) as (line, _):
        found = line.greet()
    assert (found.name, bytes(8) == found.firmware) == (name.encode().ljust(16, b"\0"), False)


@pytest.mark.release
@pytest.mark.compiler
def test_the_longest_unused_are_removed(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "LIMIT", 100_000)
    names = [f"bed {k}" for k in range(8)]
    paths = [build("library", replace(FREE, name=name), PLANT) for name in names]
    assert paths[-1].exists()
    assert 0 < sum(path.exists() for path in paths) < 8


@pytest.mark.compiler
def test_without_a_cache_it_is_built_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "file"))
    assert build("library", FREE, PLANT).is_file()


# Who is missing


def without(monkeypatch: pytest.MonkeyPatch, *missing: str) -> None:
    which = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name: None if name in missing else which(name))


def test_no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    without(monkeypatch, "gcc", "clang")
    with pytest.raises(Problem) as found:
        build("host", FREE, PLANT)
    assert render(found.value.diagnostics, {}) == (
        "error[E410]: there is no C compiler to build the firmware with, neither `gcc` nor `clang`\n"
        " = help: on Debian or Ubuntu: apt-get install gcc libc6-dev\n\n"
        "1 error\n"
    )


def test_the_compiler_that_cc_names_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "gcc-of-nobody")
    with pytest.raises(Problem) as found:
        build("host", FREE, PLANT)
    assert render(found.value.diagnostics, {}) == (
        "error[E410]: there is no C compiler `gcc-of-nobody`, which $CC names, to build the firmware with\n"
        " = help: name one that is there, or unset CC\n\n"
        "1 error\n"
    )


@pytest.mark.compiler
def test_a_compiler_that_does_not_build_it(monkeypatch: pytest.MonkeyPatch, fresh: Path) -> None:
    monkeypatch.setenv("CC", "gcc")
    with pytest.raises(Problem) as found:
        build("host", FREE, PLANT, flags=("-std=c89", "-DBED_ARMED=no"))
    assert found.value.diagnostics[0].code == "E410"
    assert found.value.diagnostics[0].message.startswith("`gcc` does not build the firmware: ")
    assert found.value.diagnostics[0].help == ("a compiler of C11 is needed: gcc 10 or clang 12, or newer",)
    assert list(fresh.iterdir()) == []


def test_no_cross_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    without(monkeypatch, "arm-none-eabi-gcc")
    with pytest.raises(Problem) as found:
        build("arm", FREE, PLANT)
    assert render(found.value.diagnostics, {}) == (
        "error[E411]: there is no `arm-none-eabi-gcc`, which builds the firmware for ARM\n"
        " = help: on Debian or Ubuntu: apt-get install gcc-arm-none-eabi\n\n"
        "1 error\n"
    )


def test_no_emulator(monkeypatch: pytest.MonkeyPatch) -> None:
    without(monkeypatch, "qemu-system-arm")
    with pytest.raises(Problem) as found:
        qemu(Path("bed.elf"), Path("line"))
    assert render(found.value.diagnostics, {}) == (
        "error[E412]: there is no `qemu-system-arm`, which runs the firmware for ARM\n"
        " = help: on Debian or Ubuntu: apt-get install qemu-system-arm\n\n"
        "1 error\n"
    )


# Compilers


@pytest.mark.compiler
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("level", ["-O0", "-O3"])
def test_it_builds_without_a_warning(compiler: str, level: str, monkeypatch: pytest.MonkeyPatch, fresh: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}; on Debian or Ubuntu: apt-get install {compiler}")
    monkeypatch.setenv("CC", compiler)
    more = ("-Wsign-conversion", "-Wcast-qual", "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wundef", level)
    with behind_a_terminal(STEPPED, flags=more) as (line, _):
        assert line.greet().version == 1


@pytest.mark.compiler
def test_a_header_stands_by_itself(tmp_path: Path) -> None:
    for header in sorted(building.FIRMWARE.rglob("*.h")):
        (tmp_path / "one.c").write_text(f'#include "{header.name}"\nextern int some;\n')
        folders = [f"-I{path}" for path in (building.FIRMWARE, *building.FIRMWARE.iterdir()) if path.is_dir()]
        words = ["gcc", *building.WARNINGS, *folders, "-fsyntax-only", str(tmp_path / "one.c")]
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_the_core_takes_nothing_from_a_library_and_no_floating_point() -> None:
    for path in sorted((building.FIRMWARE / "core").glob("*.[ch]")):
        text = path.read_text(encoding="utf-8")
        included = {line.split()[1] for line in text.splitlines() if line.startswith("#include <")}
        assert included <= {"<stdbool.h>", "<stddef.h>", "<stdint.h>"}, path.name
        for each in ("IEEE 754 double", "HELLO's doubles"):
            text = text.replace(each, "")
        assert not set(re.findall(r"\w+", text)) & {"double", "float", "malloc", "goto"}, path.name


def fences(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


README = building.FIRMWARE / "README.md"


def compiled_alone(name: str) -> None:
    words = ["gcc", *building.WARNINGS, f"-I{building.FIRMWARE / 'core'}", "-c", name]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.compiler
def test_the_example_of_the_readme_is_a_bed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(building.FIRMWARE / "core", "core")
    [port] = fences(README, "c")
    Path("port.c").write_text(port)
    first, second = fences(README, "python")
    names: dict[str, Any] = {}
    exec(first, names)
    text = Path("config.c").read_text()
    assert f".firmware = {{{', '.join(f'0x{byte:02x}' for byte in names['stamp'])}}}" in text
    assert any(names["stamp"])
    compiled_alone("config.c")
    compiled_alone("port.c")
    Path("bench.ic").write_text(fences(building.FIRMWARE.parents[1] / "docs" / "bed.md", "c")[0])
    exec(second.replace('"arm"', '"library"'), names)
    with behind_a_terminal(names["bed"], plant=names["plant"]) as (line, _):
        assert line.greet().name == b"bench 1".ljust(16, b"\0")


@pytest.mark.compiler
def test_the_port_of_the_readme_reads_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    more = "static int v[3], e; uint16_t adc_read(unsigned k) { return (uint16_t)v[k]; }"
    more += "uint32_t encoder_read(void) { return (uint32_t)e; }"
    more += "void put(int a, int b, int c, int d) { v[0] = a; v[1] = b; v[2] = c; e = d; }\n"
    [port] = fences(README, "c")
    Path("port.c").write_text(port + more)
    words = ["gcc", f"-I{building.FIRMWARE / 'core'}", "-shared", "-fPIC", "-o", "port.so", "port.c"]
    subprocess.run(words, check=True)
    lib, sensors = ctypes.CDLL(str(tmp_path / "port.so")), Sensors()

    def read(*values: int) -> tuple[int, ...]:
        lib.put(*values)
        lib.port_read(ctypes.byref(sensors))
        return tuple(getattr(sensors, name) for name, _ in Sensors._fields_)

    assert read(2051, 2046, 2048, 0) == (0, 0, 0, 0, 0)
    assert read(2041, 2056, 2053, -7) == (10, -7, 10, 8, 0)
    assert read(2061, 2036, 2043, 7) == (-10, 7, -10, -8, 0)
    assert [read(each, 2046, 2048, 0)[0] == 2**31 - 1 for each in (0, 15, 16, 4079, 4080)] == [
        True,
        True,
        False,
        False,
        True,
    ]
