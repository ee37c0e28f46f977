"""Text inside the TOML files that are written: strings and comments."""

from __future__ import annotations

import json


def quoted(text: str) -> str:
    r"""A TOML basic string; what UTF-8 cannot hold (half a surrogate pair) becomes a question mark.

    >>> print(quoted('7" rack\\left'))
    "7\" rack\\left"
    """
    sound = text.encode("utf-8", "replace").decode("utf-8")
    # a JSON string is a TOML basic string, except DEL, which JSON leaves as it is
    return json.dumps(sound, ensure_ascii=False).replace("\x7f", "\\u007f")


def on_one_line(text: str) -> str:
    r"""As a comment takes it: line breaks and what else cannot be printed become underscores.

    >>> on_one_line('drive\n1 "north".mcap')
    'drive_1 "north".mcap'
    """
    return "".join(c if c.isprintable() else "_" for c in text)
