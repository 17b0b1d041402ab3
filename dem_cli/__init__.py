"""dem-cli: 2D granular mechanics from the command line."""

__version__ = "0.1.0"
