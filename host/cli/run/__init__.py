"""The commands of the group "Run and verify": a file a command, and what they share."""
