"""The bed's firmware, built: for this machine behind a pseudo-terminal, as a library, for a Cortex-M3 under QEMU.

The sources are in hw/firmware; what differs from bed to bed is a `Config` and, where the bed is simulated, the text of
its plant.c (hw/firmware/plant.h). What was built once is kept in the user's cache folder, under the hash of everything
that made it.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import math
import os
import re
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal

from hw.bed import Capability, Limits, Scales
from hw.boards.interlock import Interlock, interlock_c
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host import cache, system

Kind = Literal["host", "library", "arm", "pico"]

FIRMWARE = Path(__file__).parents[1] / "firmware"
"""The folder with the C sources."""

WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror", "-ffp-contract=off")
"""Flags for every source: all warnings are errors, and no multiply-add is formed that is not written."""

CROSS_COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"

LIMIT = 1 << 28
"""Size of the folder of products, bytes, above which those longest unused are removed."""

_PRODUCTS: Mapping[Kind, str] = {"host": "bed-host", "library": "libbed.so", "arm": "bed.elf", "pico": "bed.elf"}

_BARE = (
    "-O2",
    "-mthumb",
    "-ffreestanding",
    "-nostdlib",
    "-static",
    "-ffunction-sections",
    "-fdata-sections",
    "-fno-tree-loop-distribute-patterns",
    "-Wl,--gc-sections",
    "-Wl,--fatal-warnings",
)

_FLAGS: Mapping[Kind, tuple[str, ...]] = {
    "host": ("-O2",),
    "library": ("-O2", "-shared", "-fPIC"),
    "arm": ("-mcpu=cortex-m3", *_BARE),
    "pico": ("-mcpu=cortex-m0plus", *_BARE),
}

_CROSS: Mapping[Kind, str] = {"arm": "arm/lm3s6965.ld", "pico": "pico/rp2040.ld"}
"""The linker's scripts of kinds that are built for another processor."""


@frozen(kw_only=True)
class Shaft:
    """A bed's shaft by its data sheets, from which a dead or reversed tachometer is detected.

    kt, resistance, tau_max   of the drive motor, N m/A, ohm, N m;  kt_load: of the load motor, N m/A
    inertia, f_c, f_v         of the shaft with both rotors, kg m^2, N m, N m s/rad
    f_cut                     of the tachometer's filter, Hz
    """

    kt: float
    resistance: float
    tau_max: float
    kt_load: float
    inertia: float
    f_c: float
    f_v: float
    f_cut: float


@frozen(kw_only=True)
class Config:
    """One bed, in SI. What it counts with is whole counts of its scales, rounded to the safe side.

    name                1 to 16 printable characters of ASCII
    tick_hz, deadman    the device's own ticks, Hz; s, 0.010 to 0.020
    continuous_current  that the load bears for ever, A: above it `limits.heat` (A^2 s) is used up
    trip                measured load current beyond which it is a fault, as a share of `limits.current`
    drive_current       measured drive current beyond which it is a fault, A; where it is measured
    shaft               None: nobody watches the tachometer
    capabilities        ENCODER ... WATCHDOG as the port has them; LOCK_STEP of a simulated plant; SIMULATED is added
    interlock           None: there is none; else INTERLOCK is added, and the port has a `board_interlock_port`
    """

    name: str
    tick_hz: float
    deadman: float = 0.015
    scales: Scales
    limits: Limits
    continuous_current: float
    trip: float = 1.1
    drive_current: float = 0.0
    shaft: Shaft | None = None
    capabilities: Capability = Capability(0)
    interlock: Interlock | None = None


# Of the numbers of hw/firmware/core/guard.h.

FRICTION = 2.0
"""Largest dry friction that the guard allows for, over the data sheet's: a shaft breaks away at more than it slides
at."""

TOLERANCE = 0.25
"""Share by which a torque may differ from the data sheet's: 10 % of a torque constant, and a winding hotter by 40 K,
at 0.39 % a kelvin."""

CHANGE = 0.01
"""Share of the limit of rate by which the rate must certainly change before the guard judges: above a tachometer's
noise, below harmful rates. At least 16 counts."""

LAG = 3.0
"""Time for which the tachometer's filter remembers, in units of its delay sqrt(2)/(2 pi f_cut): a twentieth is left."""

_ROOM = 1 << 60
"""Bound on the products of the guard's whole numbers, so that they fit into 64 bits."""

GUARD_BITS = 24
"""Bits behind the point in the guard's fractions; fewer where a tick of a light shaft is many fine counts."""

_BEYOND = 2.0**62
"""The number for any larger one: none of this size is accepted."""


class Uncountable(ValueError):
    """A configuration whose numbers the device cannot count. remedy: the change to the deck's bed."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.remedy = remedy


def build(
    kind: Kind,
    config: Config,
    plant_c: str | None = None,
    *,
    sources: Sequence[Path] = (),
    flags: Sequence[str] = (),
    texts: Mapping[str, str] | None = None,
) -> Path:
    """The firmware of one bed: a program ("host"), a shared library, or an ELF file for lm3s6965evb ("arm") or a
    Raspberry Pi Pico ("pico", which hw/boards/pico.py makes an image of).

    plant_c   text of the simulated plant; None for a library, whose port is in `sources`, and for a Pico with motors
    flags     more words for the compiler;  texts: more sources, by their names

    Problem E410, E411: there is no compiler, or it does not build this. ValueError: a config that cannot be counted
    (`Uncountable`), or whose ticks are not the plant's periods.
    """
    if plant_c is None and kind not in ("library", "pico"):
        raise ValueError(f"firmware of kind {kind!r} needs a plant")
    compiler = _compiler(kind)
    texts = {**(texts or {}), "config.c": config_c(config, plant=plant_c is not None)}
    if plant_c is not None:
        _check_period(config, plant_c)
        texts["plant.c"] = plant_c
    files = _sources(kind, plant=plant_c is not None) + [Path(path) for path in sources]
    words = [*WARNINGS, *_FLAGS[kind], *(() if kind in _CROSS else _fused()), *flags]
    read = sorted([*FIRMWARE.rglob("*.h"), *([FIRMWARE / _CROSS[kind]] if kind in _CROSS else ())])
    stamp = firmware_hash([*files, *read], texts)
    texts["config.c"] = config_c(config, plant=plant_c is not None, firmware=stamp)
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True).stdout
    name = cache.key(
        kind,
        compiler,
        version,
        *words,
        *(word for pair in sorted(texts.items()) for word in pair),
        *(word for path in [*files, *read] for word in (path.name, path.read_text(encoding="utf-8"))),
    )
    return _cached(name, _PRODUCTS[kind], lambda folder: _compile(kind, compiler, words, files, texts, folder))


def firmware_hash(files: Sequence[Path], texts: Mapping[str, str]) -> bytes:
    """First eight bytes of the SHA-256 of what is built: files of the firmware, and texts that were written for it,
    such as config.c with the hash left zero, by their names."""
    digest = hashlib.sha256()
    for name, text in sorted([*((path.name, path.read_text(encoding="utf-8")) for path in files), *texts.items()]):
        for part in (name, text):
            digest.update(len(part.encode()).to_bytes(8, "little") + part.encode())
    return digest.digest()[:8]


def qemu(elf: Path, socket: Path) -> list[str]:
    """The command that runs an ELF file of kind "arm", its line a UNIX socket that it makes; it starts once someone has
    connected. Problem E412: there is no emulator."""
    if shutil.which(EMULATOR) is None:
        raise Problem(
            error(
                "E412",
                f"there is no `{EMULATOR}`, which runs the firmware for ARM",
                help="on Debian or Ubuntu: apt-get install qemu-system-arm",
            )
        )
    line = f"socket,id=line,path={str(socket).replace(',', ',,')},server=on,wait=on"
    return [
        EMULATOR,
        "-M",
        "lm3s6965evb",
        "-nodefaults",
        "-display",
        "none",
        "-monitor",
        "none",
        "-chardev",
        line,
        "-serial",
        "chardev:line",
        "-kernel",
        str(elf),
    ]


# Counts.


def counted(config: Config) -> tuple[dict[str, int], Limits, float]:
    """The numbers of a configuration in the device's counts, and the limits and deadman in SI that these are.

    Names are those of `bed_limit` in hw/firmware/core/bed.h, and arming_rate, load_trip, drive_trip, deadman
    (ticks), heat, continuous. Raises Uncountable where one is out of range.
    """
    s, limits, hz = config.scales, config.limits, config.tick_hz
    fields = {**_fields(s, "scale of "), **_fields(limits, "limit of "), "tick rate": hz}
    for what, value in fields.items():
        _check_above_0(what, value)
    counts = {
        "voltage": _whole(limits.voltage / s.voltage),
        "current": _whole(limits.current / s.current),
        "rate": _whole(limits.rate / s.rate),
        "voltage_slew": _whole(limits.voltage_slew / (s.voltage * hz)),
        "current_slew": _whole(limits.current_slew / (s.current * hz)),
        "arming_rate": _whole(limits.arming_rate / s.rate),
        "load_trip": _whole(config.trip * limits.current / s.current),
        "drive_trip": _whole(config.drive_current / s.drive_current),
        "deadman": _whole(config.deadman * hz),
    }
    for what, count in counts.items():
        if not (0 if what == "drive_trip" else 1) <= count < 2**31 - 1:
            words = f"{what.replace('_', ' ')} is {count:.10g} counts, not 1 to 2147483646"
            step = f"a {'smaller' if count < 1 else 'larger'} `{_STEPS.get(what, 'converter_current')}`"
            raise Uncountable(words, step)
    counts["heat"] = _whole(limits.heat / s.current**2 * hz)
    counts["continuous"] = _whole((config.continuous_current / s.current) ** 2)
    if max(counts["heat"], counts["continuous"]) >= _ROOM:
        raise Uncountable("the current's scale is too fine for the I2t of the load", "a larger `converter_current`")
    deadman = counts["deadman"] / hz
    if not 0.010 - 1e-9 <= deadman <= 0.020 + 1e-9:
        raise Uncountable(f"a deadman of {deadman:g} s, in whole ticks, is not 0.010 to 0.020 s", "another rate")
    deadman = min(max(deadman, 0.010), 0.020)  # rounding may leave it just outside
    announced = Limits(
        voltage=counts["voltage"] * s.voltage,
        current=counts["current"] * s.current,
        rate=counts["rate"] * s.rate,
        arming_rate=counts["arming_rate"] * s.rate,
        voltage_slew=counts["voltage_slew"] * s.voltage * hz,
        current_slew=counts["current_slew"] * s.current * hz,
        heat=limits.heat,
    )
    return counts, announced, deadman


_STEPS = {
    "voltage": "converter_voltage",
    "voltage_slew": "converter_voltage",
    "rate": "converter_in",
    "arming_rate": "converter_in",
}
"""The parameter of a deck's bed that sets each scale; the scales that are not here are set by `converter_current`."""


def _fields(numbers: Scales | Limits, what: str) -> dict[str, float]:
    return {what + name.replace("_", " "): getattr(numbers, name) for name in type(numbers).__dataclass_fields__}


def _check_above_0(what: str, value: float, *, or_0: bool = False) -> None:
    if not (math.isfinite(value) and (value > 0.0 or (or_0 and value == 0.0))):
        raise Uncountable(f"{what} is {value:g}, not a number above 0", "numbers of a size that a bed may have")


def _whole(value: float) -> int:
    """A number rounded down to a whole one, with an allowance for rounding just below a whole number."""
    return math.floor(min(value, _BEYOND) * (1.0 + 1e-12))


def guard(config: Config) -> dict[str, int]:
    """The fields of `guard_tachometer_config` (hw/firmware/core/guard.h); all zero without a shaft. Uncountable where
    it cannot be watched."""
    names = ("bits", "voltage", "back_emf", "most", "current", "viscous", "friction", "tolerance", "change", "lag")
    shaft, s = config.shaft, config.scales
    if shaft is None:
        return dict.fromkeys(names, 0)
    for what, value in shaft.__dict__.items():
        _check_above_0(f"the shaft's {what}", value, or_0=what in ("f_c", "f_v"))
    limits, delay = counted(config)[0], math.sqrt(2.0) / (2.0 * math.pi * shaft.f_cut)
    lag, tolerance = LAG * delay * config.tick_hz, round(TOLERANCE * 256.0)
    if lag >= 2**31:
        raise Uncountable("the tachometer's filter is too slow for its guard", "a larger `f_cut`")
    unit = shaft.inertia * config.tick_hz * s.rate  # N m, of a torque that changes the rate by a count in a tick
    per = 1.0 / max(unit, 1e-300)
    armature = shaft.kt / shaft.resistance
    products_of = {
        "voltage": armature * s.voltage * per,
        "back_emf": armature * shaft.kt * s.rate * per,
        "most": shaft.tau_max * per,
        "current": shaft.kt_load * s.current * per,
        "viscous": shaft.f_v * s.rate * per,
        "friction": FRICTION * shaft.f_c * per,
    }
    highest = products_of["voltage"] * limits["voltage"] + products_of["back_emf"] * limits["rate"]
    products_of["most"] = min(products_of["most"], highest)  # a torque that no voltage reaches takes no room
    load, viscous = products_of["current"] * limits["current"], products_of["viscous"] * limits["rate"]
    products = (
        highest,
        256.0 * products_of["most"],
        256.0 * load,
        products_of["friction"],
        # the certain change in a tick, summed while a rate is awaited
        (products_of["most"] + load + viscous) * (lag + 2.0),
    )
    if not all(product <= _ROOM // 8 for product in products):
        raise Uncountable(
            "the scales are too fine, or the shaft too light, for the tachometer's guard",
            "a larger `inertia` or `converter_in`",
        )
    bits = min(GUARD_BITS, math.floor(math.log2(_ROOM // 8 / max(products))))
    return {
        "bits": bits,
        **{name: round(value * 2.0**bits) for name, value in products_of.items()},
        "tolerance": tolerance,
        "change": max(16, math.ceil(CHANGE * limits["rate"])),
        "lag": math.ceil(lag),
    }


_PERIOD = re.compile(r"\bplant_period\s*=\s*([^;]*?)\s*;")


def _check_period(config: Config, plant_c: str) -> None:
    """Raise ValueError where the period of the simulated plant (the bed's shaft and motors) is not a tick of the
    firmware."""
    match_ = _PERIOD.search(plant_c)
    word = "" if match_ is None else match_[1]
    macro = re.search(rf"#\s*define\s+{re.escape(word)}\s+(\S+)", plant_c) if word.isidentifier() else None
    word = word if macro is None else macro[1]
    try:
        period = float.fromhex(word) if "x" in word else float(word)
    except ValueError:
        raise ValueError("plant.c does not say its `plant_period` as a number") from None
    if not abs(period * config.tick_hz - 1.0) < 1e-6:
        raise ValueError(f"a tick of {config.tick_hz:g} Hz is not the plant's period, {period:g} s")


def _bytes(data: bytes) -> str:
    return ", ".join(f"0x{byte:02x}" for byte in data)


def _double(value: float) -> str:
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016x}u"


def config_c(config: Config, *, plant: bool, firmware: bytes = bytes(8)) -> str:
    """The text of config.c: one bed's numbers. plant: the bed is a simulated one;  firmware: `firmware_hash` of what is
    built, this text with zeros in its place included. ValueError: a config that cannot be."""
    counts, limits, deadman = counted(config)
    s, g = config.scales, guard(config)
    if not (1 <= len(config.name) <= 16 and config.name.isascii() and config.name.isprintable()):
        raise ValueError(f"the name {config.name!r} is not 1 to 16 printable characters of ASCII")
    capabilities = config.capabilities | (Capability.SIMULATED if plant else Capability(0))
    lock = config.interlock
    if lock is not None:
        capabilities |= Capability.INTERLOCK
    if Capability.LOCK_STEP in capabilities and not plant and Capability.SIMULATED not in capabilities:
        raise ValueError("lock-step is for simulated plants")
    announced = (
        config.tick_hz,
        deadman,
        s.voltage,
        s.current,
        s.rate,
        s.angle,
        s.drive_current,
        s.acceleration,
        limits.voltage,
        limits.current,
        limits.rate,
        limits.arming_rate,
        limits.voltage_slew,
        limits.current_slew,
        limits.heat,
    )
    in_force = ("voltage", "current", "rate", "voltage_slew", "current_slew")
    lines = [
        "/* One bed's numbers, written by hw/boards/build.py. */",
        '#include "board.h"' if plant else '#include "bed.h"',
        "",
        "extern const bed_config board_config;",
        *([] if plant else ["extern const bed_plant board_plant;"]),
        *([] if lock is None else interlock_c(lock, config.tick_hz, s, counts["arming_rate"], capabilities)),
        "const bed_config board_config = {",
        f"    .capabilities = 0x{int(capabilities):04x}u,",
        f"    .firmware = {{{_bytes(firmware)}}},",
        f"    .name = {{{_bytes(config.name.encode().ljust(16, bytes(1)))}}},",
        "    .announced = {",
        *(f"        {_double(value)}, /* {value!r} */" for value in announced),
        "    },",
        f"    .limits = {{{', '.join(str(counts[name]) for name in in_force)}}},",
        *(f"    .{name} = {counts[name]}," for name in ("arming_rate", "load_trip", "drive_trip")),
        f"    .deadman = {counts['deadman']}u,",
        f"    .heat = {{.most = {counts['heat']}, .continuous = {counts['continuous']}}},",
        "    .tachometer = {",
        *(f"        .{name} = {value}{'u' if name in ('bits', 'lag') else ''}," for name, value in g.items()),
        "    },",
        f"    .plant = {'&board_plant' if Capability.SIMULATED in capabilities else '0'},",
        *([] if lock is None else ["    .interlock = &board_interlock,"]),
        "};",
    ]
    if plant:
        scales = ", ".join(f".{name} = {getattr(s, name)!r}" for name in ("voltage", "current", "rate", "angle"))
        lines += ["", f"const board_scales board_scale = {{{scales}}};"]
    return "\n".join(lines) + "\n"


# Compilers.


def _sources(kind: Kind, *, plant: bool) -> list[Path]:
    """The C files of a kind of firmware. plant: whether it simulates its bed"""
    folders = ["core", *(["plant"] if plant else []), *(["bare", kind] if kind in _CROSS else [])]
    paths = [path for folder in folders for path in sorted((FIRMWARE / folder).glob("*.c"))]
    if kind == "pico":
        paths.remove(FIRMWARE / "pico" / ("port.c" if plant else "simulated.c"))
    if plant and kind not in _CROSS:
        paths.append(FIRMWARE / "host" / "port_host.c")
    if kind == "host":
        paths.append(FIRMWARE / "host" / "bed_host.c")
    return paths


def _compiler(kind: Kind) -> str:
    """The compiler for a kind of firmware, by name. Raises Problem E410, E411 where there is none."""
    if kind in _CROSS:
        if shutil.which(CROSS_COMPILER) is None:
            raise Problem(
                error(
                    "E411",
                    f"there is no `{CROSS_COMPILER}`, which builds the firmware for ARM",
                    help="on Debian or Ubuntu: apt-get install gcc-arm-none-eabi",
                )
            )
        return CROSS_COMPILER
    wanted = [os.environ["CC"]] if os.environ.get("CC") else ["gcc", "clang"]
    for name in wanted:
        if shutil.which(name) is not None:
            return name
    if os.environ.get("CC"):
        message = f"there is no C compiler `{wanted[0]}`, which $CC names, to build the firmware with"
        raise Problem(error("E410", message, help="name one that is there, or unset CC"))
    raise Problem(
        error(
            "E410",
            "there is no C compiler to build the firmware with, neither `gcc` nor `clang`",
            help="on Debian or Ubuntu: apt-get install gcc libc6-dev",
        )
    )


def _compile(
    kind: Kind, compiler: str, words: list[str], files: Sequence[Path], texts: Mapping[str, str], folder: Path
) -> None:
    """Compile the firmware into a folder. texts: generated files. Raises Problem where the compiler refuses it."""
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    include = [f"-I{FIRMWARE / name}" for name in (".", "core", "plant", *(["pico"] if kind == "pico" else []))]
    ends = [f"-T{FIRMWARE / _CROSS[kind]}", "-lgcc"] if kind in _CROSS else []
    written = [str(folder / name) for name in sorted(texts)]
    command = [compiler, *words, *include, *map(str, files), *written, "-o", str(folder / _PRODUCTS[kind]), *ends]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        first = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200])
        raise Problem(
            error(
                "E411" if kind in _CROSS else "E410",
                f"`{compiler}` does not build the firmware: {first}",
                help="a compiler of C11 is needed: gcc 10 or clang 12, or newer",
            )
        )


def _fused() -> tuple[str, ...]:
    """The compiler's flag for this processor's fused multiply-add, which the simulated shaft needs. Without it one in
    software gives the same bits."""
    return ("-mfma",) if "fma" in system.cpu_flags() else ()


# What was built before.


def _cached(name: str, product: str, make: Callable[[Path], None]) -> Path:
    """A product by the hash of what makes it; made, and kept, where it is not there as it was made.

    Folders are made under another name and renamed, so that any number of processes may share them. Where the cache
    cannot be used, the product is in a folder that lasts as long as this process.
    """
    root = cache.within("firmware")
    try:
        if root is None:
            raise OSError
        product_file = root / name[:32] / product
        if _is_sound(product_file, name):
            with contextlib.suppress(OSError):
                os.utime(product_file.parent)
            return product_file
        new_folder = Path(tempfile.mkdtemp(dir=root, prefix=".new-"))
    except OSError:
        new_folder = Path(tempfile.mkdtemp(prefix="met-firmware-"))
        atexit.register(shutil.rmtree, new_folder, ignore_errors=True)
        make(new_folder)
        return new_folder / product
    try:
        make(new_folder)
        (new_folder / _SUM).write_bytes(cache.digest_of(name, (new_folder / product).read_bytes()))
        for path in (new_folder / product, new_folder / _SUM):  # whatever the umask lets others do
            with contextlib.suppress(OSError):  # a file system without permissions
                path.chmod(0o700)
        with contextlib.suppress(OSError):  # another process was faster
            new_folder.rename(product_file.parent)
    finally:
        shutil.rmtree(new_folder, ignore_errors=True)
    _trim(root, keep=product_file.parent)
    return product_file


_SUM = "sum"
"""Name of the file beside a product with its checksum."""


def _is_sound(product_file: Path, name: str) -> bool:
    """True where a product is there as it was made; a damaged one is removed."""
    if not product_file.parent.exists():
        return False
    data, checksum = cache.read(product_file), cache.read(product_file.with_name(_SUM))
    if data is not None and checksum == cache.digest_of(name, data) and cache.within("firmware", name[:32]):
        return True
    # away under a name of its own, for another process may be at it too
    leaving = Path(tempfile.mkdtemp(dir=product_file.parents[1], prefix=".old-"))
    try:
        product_file.parent.rename(leaving / "was")
    except FileNotFoundError:
        pass
    finally:
        shutil.rmtree(leaving, ignore_errors=True)
    return False


def _trim(root: Path, keep: Path) -> None:
    """Remove the folders longest unused while all together are larger than `LIMIT` bytes."""
    with contextlib.suppress(OSError):
        folders = [
            (path.stat().st_mtime, sum(file.stat().st_size for file in path.iterdir()), path)
            for path in root.iterdir()
            if not path.name.startswith(".")
        ]
        total = sum(size for _, size, _ in folders)
        for _, size, path in sorted(folders):
            if total <= LIMIT:
                break
            if path != keep:
                shutil.rmtree(path, ignore_errors=True)
                total -= size
