"""Studies use robots, runs and records; only command line, public names, docs/generate and bench import them."""
