"""Whole runs in headless Chromium, number by number against the native kernel: the figures of docs/engine.md.

PYTHONPATH=scripts python -m tests.batch.portable.bits_in_chromium

A page with the policy of `met view` holds `kernel.js` and runs each module by it, both with the module's own
multiply-add and with the machine's, where that proves right.
"""

from __future__ import annotations

import base64
import json
import tempfile
from pathlib import Path

import numpy as np

from met.backends.wasm import module
from met.backends.wasm.module import KERNEL_JS
from tests.batch.report.browser import Page, browser, quiet
from tests.met.backends.whole_runs import WholeRun, differing, every

RUN = """(({ bytes, description, inputs, width, last, machine }) => {
    const whole = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const numbers = new Float64Array(whole(inputs).buffer);
    const cases = Array.from({ length: width[0] }, (_, n) => numbers.subarray(n * width[1], (n + 1) * width[1]));
    const kernel = METKernel.make(whole(bytes), description, machine ?? METKernel.fuses());
    const { rows, outputs } = kernel.run(cases, last);
    const text = (list) => {
        const all = new Uint8Array(list.buffer);
        let out = "";
        for (let n = 0; n < all.length; n += 30000) out += String.fromCharCode(...all.subarray(n, n + 30000));
        return btoa(out);
    };
    return [text(rows), text(outputs), kernel.fused];
})"""


def kernel_page(folder: Path) -> Path:
    """A page that has `kernel.js` and nothing else."""
    path = folder / "kernel.html"
    policy = "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'"
    head = f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy}">'
    script = KERNEL_JS.read_text(encoding="utf-8")
    path.write_text(f"<!DOCTYPE html><head>{head}</head><body><script>{script}</script></body>", encoding="utf-8")
    return path


def counted(page: Page, run: WholeRun, machine: bool | None) -> tuple[int, int, bool]:
    """Numbers of a run's rows and outputs that this page and the native kernel computed, and how many differ; and
    whether the machine's multiply-add was used. machine: False for the module's own, None for whichever is right."""
    made = module.compiled(run.recording)
    asked = {
        "bytes": base64.b64encode(made.code).decode("ascii"),
        "description": made.description,
        "inputs": base64.b64encode(np.ascontiguousarray(run.inputs, "<f8").tobytes()).decode("ascii"),
        "width": list(run.inputs.shape),
        "last": run.last,
        "machine": machine,
    }
    *texts, fused = page.run(f"{RUN}({json.dumps(asked)})")
    native = run.native()
    found = [np.frombuffer(base64.b64decode(text)).reshape(-1) for text in texts]
    pairs = [(a.reshape(-1), b) for a, b in zip(native, found, strict=True)]
    return sum(a.size for a, _ in pairs), sum(differing(a, b) for a, b in pairs), fused


def main() -> None:
    compared = {False: 0, None: 0}
    different = 0
    with tempfile.TemporaryDirectory() as folder, browser() as chromium:
        page = chromium.open(kernel_page(Path(folder)))
        for run in every():
            for machine in compared:
                count, wrong, fused = counted(page, run, machine)
                compared[machine] += count
                different += wrong
                by = "the machine's" if fused else "its own"
                print(f"{run.name}, {by} multiply-add: {count:,} numbers, {wrong} differ", flush=True)
        quiet(page)
    print(f"{compared[False]:,} numbers, and {compared[None]:,} by the multiply-add that was found; {different} differ")


if __name__ == "__main__":
    main()
