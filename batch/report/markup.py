"""HTML made of texts that may hold anything: what is no markup of ours is escaped, what cannot be seen is shown."""

from __future__ import annotations

import html
from collections.abc import Iterable

from batch.visible import visible


class Html(str):
    """Text that is HTML already."""

    __slots__ = ()


Child = str | Html | None | Iterable["Child"]

VOID = frozenset({"meta", "link", "input", "br", "rect", "line", "path"})


def text(raw: str) -> Html:
    """A text as HTML: between tags and in quoted attributes alike."""
    return raw if isinstance(raw, Html) else Html(html.escape(visible(raw), quote=True))


def el(tag: str, *children: Child, **attributes: str | float | bool | None) -> Html:
    """An element. Attributes: `cls` is class, `_` stands for `-`; None and False leave one out, True has no value."""
    words = [tag]
    for name, value in attributes.items():
        if value is None or value is False:
            continue
        name = "class" if name == "cls" else name.rstrip("_").replace("_", "-")
        words.append(name if value is True else f'{name}="{text(str(value))}"')
    if tag in VOID:
        return Html(f"<{' '.join(words)}>" if tag in ("meta", "link", "input", "br") else f"<{' '.join(words)}/>")
    return Html(f"<{' '.join(words)}>{join(children)}</{tag}>")


def join(children: Child) -> Html:
    """Children one after the other."""
    if children is None:
        return Html("")
    if isinstance(children, str):
        return text(children)
    return Html("".join(join(child) for child in children))


def lines(children: Iterable[Child]) -> Html:
    """Children a line each."""
    return Html("\n".join(join(child) for child in children if child is not None))
