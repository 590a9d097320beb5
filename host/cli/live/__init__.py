"""The commands of the group "Live board": a file a command, and what they share."""
