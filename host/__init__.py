"""The host's side: robots, kinematics, planning, the CANopen client, verification, plots and the command line."""
