"""Replay stored runs in a browser: model, marks and player know no page; only `page` and `cards` import nicegui."""
