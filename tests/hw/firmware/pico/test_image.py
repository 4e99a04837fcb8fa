"""The Pico's image: the same bytes each time and anywhere, as UF2 and the chip's ROM want them, and what it takes."""

from __future__ import annotations

import shutil
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import pytest

from hw.boards import build as building
from hw.boards.build import CROSS_COMPILER, FIRMWARE, build
from hw.boards.pico import boot2_crc, pico_image, uf2
from hw.boards.pico_bench import pico_bench, wiring_c
from tests.hw.firmware.pico.emulated import STACK_TOP
from tests.hw.firmware.test_arm import stack

pytestmark = pytest.mark.firmware


@pytest.fixture(autouse=True)
def cross_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which(CROSS_COMPILER) is None:
        pytest.skip(f"no {CROSS_COMPILER}; on Debian or Ubuntu: apt-get install gcc-arm-none-eabi")
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "cache"))


def test_the_same_bench_gives_the_same_bytes_again_and_in_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = pico_image(pico_bench())
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "another cache"))
    assert pico_image(pico_bench()) == first
    shutil.copytree(FIRMWARE, tmp_path / "else where" / "firmware")
    monkeypatch.setattr(building, "FIRMWARE", tmp_path / "else where" / "firmware")
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "a third cache"))
    assert pico_image(pico_bench()) == first


def test_another_bench_is_another_image() -> None:
    bench = pico_bench()
    other = replace(bench, wiring={**bench.wiring, "rate_zero": 2049})
    assert pico_image(other) != pico_image(bench)


def test_the_rom_s_crc_of_boot2_is_that_of_mpeg_2() -> None:
    assert boot2_crc(b"123456789") == 0x0376E6E7  # the check value of CRC-32/MPEG-2
    flash = pico_image(pico_bench())
    assert struct.unpack_from("<I", flash, 252)[0] == boot2_crc(flash[:252])


def test_head_and_crc_say_what_follows() -> None:
    flash = pico_image(pico_bench())
    stack, entry, words, crc = struct.unpack_from("<4I", flash, 256)
    assert stack == 0x20042000 and 0x10000110 <= entry < 0x10001000 and entry & 1
    assert 4 * words == len(flash) - 272 and crc == zlib.crc32(flash[272:])


def test_uf2_is_blocks_that_fill_the_flash_in_order() -> None:
    flash = pico_image(pico_bench())
    file = uf2(flash)
    assert len(file) % 512 == 0
    filled = b""
    for k in range(len(file) // 512):
        block = file[512 * k : 512 * (k + 1)]
        assert block[:8] == b"UF2\nWQ]\x9e" and block[-4:] == b"\x30\x6f\xb1\x0a"
        flags, address, size, number, of, family = struct.unpack_from("<6I", block, 8)
        assert (flags, size, number, of, family) == (0x2000, 256, k, len(file) // 512, 0xE48BFF56)
        assert address == 0x10000000 + len(filled)
        filled += block[32 : 32 + size]
    assert filled[: len(flash)] == flash and set(filled[len(flash) :]) <= {0xFF}


def test_it_fits_the_chip_and_recurses_nowhere(capsys: pytest.CaptureFixture[str]) -> None:
    bench = pico_bench()
    elf = build("pico", bench.config, texts={"wiring.c": wiring_c(bench.wiring)}, flags=("-fcallgraph-info=su",))
    done = subprocess.run(["arm-none-eabi-size", "-A", elf], capture_output=True, text=True, check=True)
    rows = [line.split() for line in done.stdout.splitlines() if line.startswith(".")]
    sizes = {name: int(size) for name, size, _ in rows}
    depth = stack(elf.parent, {"pico_main": 0, "pico_line": 32, "pico_timer": 32})
    with capsys.disabled():
        print(f"\nPico: image {sizes['.image']}, loader {sizes['.loader']}, bss {sizes['.bss']}, stack at most {depth}")
    assert sizes[".image"] < 16 * 1024 and sizes[".bss"] < 4 * 1024 and sizes[".boot2"] == 256
    assert sizes[".stack"] == STACK_TOP - 0x20000000 and 300 < depth < sizes[".stack"] // 2
