"""Trajectories and logs to files: one table of formats; every file is written, then renamed.

Nothing is imported here: :mod:`vehnav.export.atomic` alone must not cost the formats.
"""
