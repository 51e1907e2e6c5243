"""``python -m sec_lab.cli`` is ``sec-lab``."""

import sys

from sec_lab.cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
