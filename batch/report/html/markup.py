"""HTML from arbitrary texts: foreign markup is escaped, and invisible characters are shown."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable

from met.messages.visible import visible


class Html(str):
    """Text that is HTML already."""

    __slots__ = ()


Child = str | Html | None | Iterable["Child"]

RAW = frozenset({"code", "title", "option"})
"""Elements whose texts are set unchanged; in all others backticks mark code."""

QUOTED = re.compile(r"`([^`\n]+)`")

LONG = 24
"""Length of a name in letters from which on it may break after a dot or a `_`."""

DRAWN = frozenset({"rect", "line", "path"})
VOID = frozenset({"meta", "link", "input", "br", "wbr"}) | DRAWN


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
        return Html(f"<{' '.join(words)}{'/' if tag in DRAWN else ''}>")
    return Html(f"<{' '.join(words)}>{_inner(children, raw=tag in RAW)}</{tag}>")


def join(children: Child) -> Html:
    """The children, concatenated."""
    return _inner(children, raw=False)


def _inner(children: Child, *, raw: bool) -> Html:
    if children is None:
        return Html("")
    if isinstance(children, str):
        return text(children) if raw else prose(children)
    return Html("".join(_inner(child, raw=raw) for child in children))


def prose(raw: str) -> Html:
    """A sentence as HTML, with the parts between backticks set as code."""
    if isinstance(raw, Html):
        return raw
    parts = QUOTED.split(raw)
    return Html("".join(f"<code>{text(part)}</code>" if n % 2 else text(part) for n, part in enumerate(parts)))


def breaking(raw: str) -> Html:
    """A name that may break after a dot or a `_` where it is long."""
    escaped = text(raw)
    return escaped if len(raw) < LONG else Html(re.sub(r"([._])(?=\w)", r"\1<wbr>", escaped))


def lines(children: Iterable[Child]) -> Html:
    """The children, one a line."""
    return Html("\n".join(join(child) for child in children if child is not None))
