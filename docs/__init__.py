"""Documentation; `docs.generate` makes the parts that are measured."""
