"""`python -m hc_bringup` is the hc command."""

import sys

from hc_bringup.cli import main

sys.exit(main())
