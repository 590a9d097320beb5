"""`python -m steptwin`: the command line."""

from steptwin.host.cli import main

if __name__ == "__main__":
    main()
