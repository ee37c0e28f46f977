"""What was noticed while one MCAP file was read."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from vehnav.errors import Finding, Level

MAX_NOTES = 8
"""Findings of one kind that are kept word by word; the rest are counted."""


@dataclass
class Report:
    """Damage of one file.

    Attributes
    ----------
    doubt : str
        Why the indexes were not relied on, or "".
    checksums : Counter
        Chunks whose checksum is "sound", "absent", "wrong" (or "untested": not all there).
    """

    name: str
    doubt: str = ""
    checksums: Counter[str] = field(default_factory=Counter)
    _damage: list[Finding] = field(default_factory=list)
    _counts: Counter[str] = field(default_factory=Counter)

    def note(
        self, code: str, text: str, *, span: tuple[int, int] | None = None, level: Level = "error"
    ) -> None:
        """Damage: data lost, recovered or not to be verified."""
        self._counts[code] += 1
        if self._counts[code] <= MAX_NOTES:
            start, end = span if span else (None, None)
            self._damage.append(Finding(code, level, f"{self.name}: {text}", start, end))

    def count(self, checksum: str) -> None:
        """A chunk was read, with this outcome of its checksum."""
        self.checksums[checksum] += 1

    def damage(self) -> list[Finding]:
        """All damage; of many of a kind the first, and how many more."""
        more = [
            Finding(code, "error", f"{self.name}: {count - MAX_NOTES} more findings {code!r}")
            for code, count in self._counts.items()
            if count > MAX_NOTES
        ]
        return self._damage + more

    def notes(self) -> list[Finding]:
        """What is no damage but worth knowing."""
        found = []
        if self.checksums["absent"]:
            text = (
                f"{self.name}: {self.checksums['absent']} chunks carry no checksum: not verifiable"
            )
            found.append(Finding("no-checksum", "info", text))
        if self.doubt:
            text = f"{self.name}: read from front to back, because {self.doubt}"
            found.append(Finding("not-indexed", "info", text))
        return found


def signed(stamp: int) -> int:
    """u64 nanoseconds as int64, as the arrays have them."""
    return stamp - (1 << 64) if stamp >= 1 << 63 else stamp
