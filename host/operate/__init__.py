"""What the commands for a live board do, without the command line: any link, in real or in virtual time."""
