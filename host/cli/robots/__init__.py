"""The commands of the group "Robots and maths": a file a command."""
