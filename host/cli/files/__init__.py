"""The commands of the group "Files and tools": a file a command."""
