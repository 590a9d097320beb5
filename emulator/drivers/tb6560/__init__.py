"""The driver chip TB6560AHQ, modelled by the behaviour of its pins.

Source, cited by page throughout: Toshiba "TB6560AHQ/AFG", datasheet of 2014-10-01.
"""
