"""Capabilities that not every user needs: a folder each, registered by an entry point; the core imports none."""
