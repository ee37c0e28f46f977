"""Trajectories and logs to files: one table of formats; every file is written, then renamed."""
