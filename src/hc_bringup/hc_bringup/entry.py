"""Where the hc command begins: until it can answer a signal, it ends by one without a word.

`./hc` starts it with SIGINT blocked, because Python would answer one during its own start with a
traceback. An interrupt that came meanwhile is delivered here.
"""

import signal

from hc_bringup import byte_code

byte_code.arrived()
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])


def _open_what_is_closed() -> None:
    """Let standard streams that were closed lead nowhere: the next file would take their number."""
    import os
    import sys

    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            os.dup2(nowhere := os.open(os.devnull, os.O_RDWR), number)
            if nowhere != number:
                os.close(nowhere)
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115


def main() -> int:
    """Run the hc command; returns the exit status, or ends with it where a signal asked to end.

    What Python does at its end, module by module, takes seconds on a busy machine, and nobody who
    pressed Ctrl-C waits for it: everything that has to be put away is by then.
    """
    import contextlib
    import os
    import sys
    import warnings

    byte_code.spare_a_full_disk()
    try:
        from hc_bringup import cli, last_resort, standard_output
        from hc_msgs_py.warnings_of_others import ignore_those_of_others
    except (EOFError, ValueError, TypeError, ImportError) as error:
        byte_code.start_again(error)
        raise

    _open_what_is_closed()
    sys.stdout = standard_output.guarded(sys.stdout)  # type: ignore[arg-type]  # as it was made
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # they are for developers: python -W default
    ignore_those_of_others()
    signals = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as it is under nohup
        signals.append(signal.SIGHUP)
    for number in signals:
        signal.signal(number, cli.on_interrupt)
    sys.unraisablehook = last_resort.again
    try:
        status = cli.main(tell_waiting=True)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)  # that of last_resort.again
        for number in signals:
            signal.signal(number, signal.SIG_DFL)
    if cli.was_interrupted():
        if cli.hung_up():
            with contextlib.suppress(OSError, ValueError):  # the terminal; 2> leads elsewhere
                sys.stderr.write(f"hc: {cli.HUNG_UP}\n")
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):  # closed, or nobody reads it any more
                stream.flush()
        os._exit(status)
    return status
