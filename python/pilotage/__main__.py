"""`python -m pilotage`: the command."""

import sys

from ._command import main

sys.argv[0] = "pilotage"
main()
