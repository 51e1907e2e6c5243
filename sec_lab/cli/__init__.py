"""The command line: ``sec-lab COMMAND …``."""

from sec_lab.cli.entry import main as main
