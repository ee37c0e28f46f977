"""Text into markup: names from a log may hold anything, and must appear as what they are."""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Iterable, Sequence

HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories that do not show: controls, directions, lone surrogates, line separators."""


def esc(value: object) -> str:
    """Text for content and attributes: markup escaped, what cannot be seen made visible.

    >>> esc('<b>"a"&b</b>')
    '&lt;b&gt;&quot;a&quot;&amp;b&lt;/b&gt;'
    >>> esc(chr(0x202E) + "gpj.exe")
    '\\\\u202egpj.exe'
    """
    text = str(value)
    if not text.isprintable():
        text = "".join(_visible(c) for c in text)
    return html.escape(text, quote=True)


def _visible(c: str) -> str:
    if unicodedata.category(c) not in HIDDEN:
        return c
    return f"\\u{ord(c):04x}"


def _unit_kept(head: str) -> str:
    """The last word of a head, its unit, kept in one piece and with the word before it.

    A head that is markup stays as it is.
    """
    if "<" in head:
        return head
    return re.sub(r" (\S{1,2})$", "\u00a0\\1", head).replace("/", "/\u2060")


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    name: str,
    left: Sequence[int] = (0,),
    marked: int | None = None,
) -> str:
    """A table of cells that are markup already; ``left``: columns of text, the others numbers.

    ``marked``: a row that stands out.
    """
    sides = ["l" if k in left else "r" for k in range(len(head))]
    cells = "".join(
        f'<th scope="col" class="{side}">{_unit_kept(text)}</th>'
        for side, text in zip(sides, head, strict=True)
    )
    lines = []
    for k, row in enumerate(rows):
        tds = "".join(
            f'<td class="{side}">{cell}</td>' for side, cell in zip(sides, row, strict=True)
        )
        lines.append(f'<tr class="marked">{tds}</tr>' if k == marked else f"<tr>{tds}</tr>")
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{esc(name)}"><table>'
        f"<thead><tr>{cells}</tr></thead><tbody>{''.join(lines)}</tbody></table></div>"
    )
