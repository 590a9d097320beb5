"""CANopen as host and board share it: object dictionary, codecs and device-side services, without I/O or a clock."""
