"""Trajectories and logs to files: one table of formats; every file is written, then renamed."""

from __future__ import annotations

from vehnav.export.formats import FORMATS, read_trajectory, write_trajectory

__all__ = ["FORMATS", "read_trajectory", "write_trajectory"]
