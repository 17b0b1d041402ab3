"""`python -m dem_cli` is `dem`."""

from dem_cli.cli import main

main(prog_name="dem")
