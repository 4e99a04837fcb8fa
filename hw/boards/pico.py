"""The image of a Raspberry Pi Pico, the output of `met bed firmware --board pico`: a file that is dragged onto the
board.

UF2 is blocks of 512 bytes, each with 256 bytes of the flash and where they go (github.com/microsoft/uf2). The image
depends on the bench and the sources alone: the same bench gives the same bytes, in any folder.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from hw.boards.build import build
from hw.boards.pico_bench import PicoBench, wiring_c

FLASH, RAM = 0x1000_0000, 0x2000_0000
FLASH_BYTES = 2 << 20
BOOT2 = 256
"""Bytes that the chip's ROM reads first, their CRC at their end."""

HEAD = 16
"""Bytes of `image_head` (hw/firmware/pico/start.c), behind boot2."""

_FAMILY, _MAGIC, _END, _HAS_FAMILY, _PAYLOAD = 0xE48B_FF56, (0x0A32_4655, 0x9E5D_5157), 0x0AB1_6F30, 0x2000, 256


def pico_image(bench: PicoBench) -> bytes:
    """The flash of a Pico for a bench, from its first byte on. Problem E411: no compiler, or it does not build it."""
    return flash_of(build("pico", bench.config, texts={"wiring.c": wiring_c(bench.wiring)}))


def flash_of(elf: Path) -> bytes:
    """The flash that an ELF file of kind "pico" fills: its segments, with the CRCs that ROM and loader go by."""
    data = elf.read_bytes()
    (offset,) = struct.unpack_from("<I", data, 28)
    size, count = struct.unpack_from("<HH", data, 42)
    flash = bytearray()
    for k in range(count):
        kind, start, _, physical, filed = struct.unpack_from("<5I", data, offset + k * size)
        if kind != 1 or not filed:
            continue
        begin = physical - FLASH
        if not 0 <= begin <= FLASH_BYTES - filed:
            raise ValueError(f"a segment at {physical:#x} lies outside of the flash")
        flash.extend(b"\xff" * (begin + filed - len(flash)))
        flash[begin : begin + filed] = data[start : start + filed]
    flash.extend(b"\xff" * (-len(flash) % 4))
    struct.pack_into("<I", flash, BOOT2 - 4, boot2_crc(bytes(flash[: BOOT2 - 4])))
    body = bytes(flash[BOOT2 + HEAD :])
    struct.pack_into("<II", flash, BOOT2 + 8, len(body) // 4, zlib.crc32(body))
    return bytes(flash)


def boot2_crc(data: bytes) -> int:
    """The CRC-32 that the RP2040's ROM checks boot2 by: polynomial 0x04C11DB7, from all ones, not reflected, not
    inverted (RP2040 datasheet, 2.8.1.3.1)."""
    crc = 0xFFFF_FFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = ((crc << 1) ^ 0x04C1_1DB7 if crc & 0x8000_0000 else crc << 1) & 0xFFFF_FFFF
    return crc


def uf2(flash: bytes) -> bytes:
    """A UF2 file that fills the flash with these bytes, from its beginning."""
    blocks = [flash[start : start + _PAYLOAD].ljust(_PAYLOAD, b"\xff") for start in range(0, len(flash), _PAYLOAD)]
    out = bytearray()
    for k, block in enumerate(blocks):
        out += struct.pack("<8I", *_MAGIC, _HAS_FAMILY, FLASH + k * _PAYLOAD, _PAYLOAD, k, len(blocks), _FAMILY)
        out += block.ljust(476, b"\0") + struct.pack("<I", _END)
    return bytes(out)
