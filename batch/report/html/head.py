"""The head of a page that is opened from a file: it lists the digests of its scripts, and needs no network."""

from __future__ import annotations

from batch.report.html import inlined
from batch.report.html.markup import Html, el, lines


def page_head(title: str, *, generator: str, style: str, script: str, allowed: str = "") -> Html:
    """The elements of the head, with the style.

    generator  who wrote the page;  script: the only one that it may run
    allowed    a further source of code that its security policy grants: `'wasm-unsafe-eval'`
    """
    scripts = " ".join(filter(None, (inlined.digest(script), allowed)))
    rules = (
        f"default-src 'none'; script-src {scripts}; style-src {inlined.digest(style)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    return lines(
        [
            el("meta", charset="utf-8"),
            el("meta", name="generator", content=generator),
            Html(f'<meta http-equiv="Content-Security-Policy" content="{rules}">'),
            el("meta", name="viewport", content="width=device-width, initial-scale=1"),
            el("meta", name="color-scheme", content="light dark"),
            el("meta", name="referrer", content="no-referrer"),
            el("link", rel="icon", href="data:,"),
            el("title", title),
            Html(f"<style>{style}</style>"),
        ]
    )
