"""Write the generated pages of docs/: hand-written pieces with generated tables (`make docs`).

The text depends on the sources alone, not on the machine or the time, so that a test can compare the pages with it.
"""
