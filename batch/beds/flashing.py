"""`met bed firmware`: writes the image of a board, to be dragged onto it."""

from __future__ import annotations

from pathlib import Path

from hw.boards.pico import pico_image, uf2
from hw.boards.pico_bench import SHIPPED, pico_bench
from met.diagnostic import Problem, error
from met.host.files import whole_file
from met.host.streams import kept
from met.messages.visible import say
from met.outputs import check_overwrite, check_place

_UF2 = b"UF2\n"


def firmware_and_tell(bench: str | None, output: str | None, *, show: bool, quiet: bool = False) -> None:
    """Run `met bed firmware --board pico`. Raises Problem."""
    if show:
        say((SHIPPED if bench is None else Path(bench)).read_text(encoding="utf-8").rstrip("\n"))
        return
    try:
        pico = pico_bench(bench)
    except OSError as reason:
        message = f"{bench} cannot be read: {(reason.strerror or str(reason)).lower()}"
        raise Problem(error("E447", message, help="`met bed firmware --board pico --show` prints a bench")) from None
    name = pico.config.name
    target = Path(output or f"{''.join(c if c.isalnum() else '-' for c in name)}.uf2")
    try:
        check_place(target, code="E448")
        check_overwrite(target, _is_uf2, code="E448", because=" and is no image of a board")
        image = uf2(pico_image(pico))
        with whole_file(target) as file:
            file.write(image)
    except OSError as reason:
        message = f"cannot write {target}: {(reason.strerror or str(reason)).lower()}"
        raise Problem(error("E448", message, help="give another name with `-o`")) from None
    if not quiet:
        with kept(f"{target} is whole"):
            limits = pico.config.limits
            say(
                f"bed `{name}`: {limits.voltage:g} V, {limits.current:g} A, {limits.rate:g} rad/s, "
                f"ticks of {pico.config.tick_hz:g} Hz\n"
                f"image  {target}  ({len(image) // 512 * 256 / 1024:.1f} KiB of flash)\n"
                "next   hold BOOTSEL while the Pico is plugged in, and drag the image onto the drive that appears\n"
                "before a motor is connected, see the checks with a meter in docs/pico.md"
            )


def _is_uf2(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(len(_UF2)) == _UF2
