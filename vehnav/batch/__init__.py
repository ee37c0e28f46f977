"""Many logs against bars and a baseline: suite, runner, JUnit, tables, job summary, index."""
