"""Run the command line: `python -m steptwin`."""

from steptwin.host.cli import main

if __name__ == "__main__":
    main()
