"""The hardware around the firmware: virtual time, CAN bus, TB6560 drivers, traces."""
