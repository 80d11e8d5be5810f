"""Entry point of ``python -m flexclear``."""

import sys

from flexclear.commands.__main__ import main

if __name__ == "__main__":
    sys.exit(main())
