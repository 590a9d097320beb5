"""The documentation; `docs.generate` writes the pages that follow from code, robot files and runs."""
