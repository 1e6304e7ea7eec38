"""`python -m lidarspectra` is the command `lidarspectra`."""

from lidarspectra.cli.app import main

if __name__ == "__main__":
    main()
