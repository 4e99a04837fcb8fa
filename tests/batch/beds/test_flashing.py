"""`met bed firmware`: a bench's file to an image that is dragged onto a board."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from hw.boards import build as building
from hw.boards.pico_bench import SHIPPED, pico_bench
from met import cli
from met.diagnostic import Problem

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def firmware(met_bed: Command) -> Command:
    return lambda *words: met_bed("firmware", "--board", "pico", *words)


@pytest.mark.firmware
def test_the_image_of_the_bench_that_is_wired_in_the_documentation(firmware: Command, here: Path) -> None:
    if shutil.which(building.CROSS_COMPILER) is None:
        pytest.skip(f"no {building.CROSS_COMPILER}; on Debian or Ubuntu: apt-get install gcc-arm-none-eabi")
    status, said, wrong = firmware()
    assert (status, wrong) == (cli.YES, "")
    lines = said.splitlines()
    assert lines[0] == "bed `pico bench`: 20 V, 3 A, 350 rad/s, ticks of 1000 Hz"
    assert lines[1].startswith("image  pico-bench.uf2  (") and lines[1].endswith(" KiB of flash)")
    image = Path("pico-bench.uf2").read_bytes()
    assert firmware("-q")[:2] == (cli.YES, "")  # an image may be written over
    assert Path("pico-bench.uf2").read_bytes() == image
    (here / "mine.toml").write_text(SHIPPED.read_text(encoding="utf-8").replace("350 rad/s", "300 rad/s"))
    assert firmware("mine.toml", "-o", "mine.uf2")[0] == cli.YES
    assert Path("mine.uf2").read_bytes() != image


def test_show_prints_the_bench_to_begin_with(firmware: Command) -> None:
    status, said, _ = firmware("--show")
    assert status == cli.YES and said == SHIPPED.read_text(encoding="utf-8")
    status, _, wrong = firmware("--show", "-o", "x.uf2")
    assert status == cli.BAD_INPUT and "`--show` writes no file: leave `-o` out" in wrong


def test_what_is_there_and_no_image_is_not_written_over(firmware: Command, here: Path) -> None:
    (here / "notes.txt").write_text("mine", encoding="utf-8")
    assert firmware("-o", "notes.txt") == (
        cli.BAD_INPUT,
        "",
        "error[E448]: notes.txt exists and is no image of a board: it is not written over\n"
        " = help: give another name with `-o`, or remove the file\n\n"
        "1 error\n",
    )
    assert firmware("-o", "nowhere/x.uf2")[2].startswith("error[E448]: cannot write nowhere/x.uf2: nowhere does not ")


def test_without_a_compiler_for_arm_it_says_what_to_install(firmware: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    status, _, wrong = firmware()
    assert status == cli.BAD_INPUT and not Path("pico-bench.uf2").exists()
    assert wrong.startswith("error[E411]: there is no `arm-none-eabi-gcc`, which builds the firmware for ARM\n")


def test_a_bench_that_is_not_there(firmware: Command) -> None:
    status, _, wrong = firmware("nobody.toml")
    assert status == cli.BAD_INPUT
    assert wrong.startswith("error[E447]: nobody.toml cannot be read: no such file or directory\n")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"24 V"', '"24 A"', "`voltage_full` is no quantity above zero in V: '24 A'"),
        ('"24 V"', '"-24 V"', "`voltage_full` is no quantity above zero in V: '-24 V'"),
        ('"24 V"', "24", "`voltage_full` is no quantity above zero in V: 24"),
        ("= 2000 ", "= true ", "`encoder` is no whole number above zero: True"),
        ("key                 = true", 'key = "yes"', "`key` is no true or false: 'yes'"),
        ('"pico bench"', '"a bench for us all"', "`name` is no text of 1 to 16 letters: 'a bench for us all'"),
        (
            '"15 ms"',
            '"25 ms"',
            "the bench cannot be counted: a deadman of 0.025 s, in whole ticks, is not 0.010 to 0.020",
        ),
        ('"1 kHz"', '"10 kHz"', "a tick of 10000 Hz is not 200 Hz to 4 kHz"),
        ('"400 rad/s"', '"360 rad/s"', "`shaft.rate_limit` is beyond 95 % of `shaft.rate_range`"),
        (
            'voltage_limit      = "20 V"',
            'voltage_limit = "24 V"',
            "`drive.voltage_limit` is more than the amplifier holds",
        ),
        ('# angle_least = "-3 rad"', 'angle_least = "-3 rad"', "[shaft] has `angle_least` and no `angle_most`"),
        ("warmest             = 80", "warmest = 500", "at 500 degC the thermistor reads "),
        ('bus_most            = "32 V"', 'bus_most = "12 V"', "`bus_least` is not below `bus_most`"),
        ("[load] ", "[loud] ", "a bench has no `loud`"),
        ('tick    = "1 kHz"', "", "[bed] has no `tick`"),
        ("[bed]", "[bed", "bench.toml is no TOML: "),
    ],
)
def test_what_is_wrong_in_a_bench_is_said_with_its_place(old: str, new: str, said: str, here: Path) -> None:
    text = SHIPPED.read_text(encoding="utf-8")
    path = here / "bench.toml"
    assert text.count(old) == 1, old
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(Problem) as found:
        pico_bench(path)
    [wrong] = found.value.diagnostics
    assert wrong.code == "E447" and wrong.message.startswith(said.replace("bench.toml", str(path)))
    assert wrong.at is not None and wrong.at.place.file == str(path) and wrong.help


def test_a_rate_without_a_tachometer_is_the_encoder_s(here: Path) -> None:
    lines = SHIPPED.read_text(encoding="utf-8").splitlines()
    path = here / "bench.toml"
    path.write_text("\n".join(line for line in lines if not line.startswith("rate_range")), encoding="utf-8")
    bench = pico_bench(path)
    assert bench.wiring["rate_ticks"] == 9 and bench.config.interlock is not None
    assert bench.config.interlock.f_cut is None
    assert bench.config.scales.rate == pytest.approx(bench.config.scales.angle / 9e-3)


def test_the_thermistor_s_limit_is_what_it_reads_when_it_is_so_warm() -> None:
    """By the resistance that data sheets of a 10 kohm thermistor of B = 3950 K give: 1.27 kohm at 80 degC, to 5 %."""
    lock = pico_bench().config.interlock
    assert lock is not None
    reading = 4079 - lock.warmest
    assert 4.7e3 * reading / (4095 - reading) == pytest.approx(1.27e3, rel=0.05)
