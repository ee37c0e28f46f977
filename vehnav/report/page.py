"""The frame of every page: one self-contained document in one look, and its sections."""

from __future__ import annotations

import base64
import hashlib
from importlib import resources

from vehnav._version import __version__
from vehnav.report.markup import esc


def section(key: str, title: str, content: str, note: str = "") -> str:
    """A part of the page with its title; nothing where there is no content (markup)."""
    if not content:
        return ""
    note = f'<p class="note">{note}</p>' if note else ""
    return f'<section id="{key}"><h2>{esc(title)}</h2>{content}{note}</section>'


def page(title: str, body: str, *, script: str | None = None, style: str = "") -> str:
    """The whole document; its policy lets nothing load and no script run but its own.

    ``script`` replaces the one that moves the cursor through map and plots; ``style`` is added.
    """
    style = _resource("page.css") + style
    script = _resource("page.js") if script is None else script
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'"
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<meta name="generator" content="vehnav {esc(__version__)}">'
        f'<link rel="icon" href="data:,"><title>{esc(title)} - vehnav</title>'
        f"<style>{style}</style></head>\n<body>{body}"
        f"<footer>vehnav {esc(__version__)}</footer>\n<script>{script}</script></body></html>\n"
    )


def _resource(name: str) -> str:
    return resources.files("vehnav.report").joinpath(name).read_text("utf-8")
