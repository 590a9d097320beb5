"""The operator's desk: one machine on one bus, which any number of pages watch and one operator moves.

Begin reading at `desk.py: Desk`, which pages read and ask; `commands.py` and `jogs.py` have what they may ask for, and
`state.py: Snapshot` what they see. Nothing here knows of a page.
"""
