"""A board in real time: its pacing, and its servers for other programs."""
