"""Common ground of all rooms of host: errors, checks of input, readers of untrusted files, array types."""
