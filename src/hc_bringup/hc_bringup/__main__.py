"""`python -m hc_bringup` is the hc command."""

import sys

from hc_bringup.entry import main

sys.exit(main())
