"""Read what motion controllers' configurations say of a machine: Klipper, grbl and grblHAL, Marlin, LinuxCNC."""
