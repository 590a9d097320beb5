"""Shared by all packages of host: errors, input checks, readers of untrusted files, array types."""
