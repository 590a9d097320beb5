"""The firmware's kernel on an emulated Cortex-M3: compiled by a cross compiler, executed by Unicorn (extra `m3`)."""
