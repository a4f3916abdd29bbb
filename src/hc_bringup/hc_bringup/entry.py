"""Where the hc command begins: until it can answer an interrupt, it ends by one without a word.

`./hc` starts it with SIGINT blocked, because Python would answer one during its own start with a
traceback. An interrupt that came meanwhile is delivered here.
"""

import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])


def main() -> int:
    """Run the hc command; returns the exit status."""
    import sys
    import warnings

    from hc_bringup import cli

    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # they are for developers: python -W default
    signal.signal(signal.SIGINT, cli.on_interrupt)
    try:
        return cli.main(tell_compilation=True)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
