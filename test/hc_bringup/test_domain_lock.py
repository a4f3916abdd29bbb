"""A second run in a domain, beside one that is stopped."""

import os
import signal
import time

import pytest

from hc_bringup.domain_lock import DomainLock
from hc_bringup.errors import UserError
from hc_bringup.process_state import is_stopped

HOLDS = (
    "import sys, time; from hc_bringup.domain_lock import DomainLock\n"
    "with DomainLock(int(sys.argv[1])): print('held', flush=True); time.sleep(600)"
)


@pytest.mark.process
def test_beside_a_stopped_run_it_is_said_how_that_ends(processes, ros_domain):
    """Regression: "end it first", of a process that no Ctrl-C and no kill would end."""
    held = processes.start("-c", HOLDS, str(ros_domain))
    try:
        assert held.stdout.readline() == "held\n"
        told = f"process {held.pid} .*: end it first.*a second robot in this one: a node"
        with pytest.raises(UserError, match=told):
            DomainLock(ros_domain).__enter__()
        os.kill(held.pid, signal.SIGSTOP)
        while not is_stopped(held.pid):
            time.sleep(0.01)
        way_out = f"kill -CONT {held.pid} lets it go on, kill -9 ends it, or take another domain"
        with pytest.raises(UserError, match=f"it is stopped: {way_out}"):
            DomainLock(ros_domain).__enter__()
    finally:
        held.kill()
        held.wait()
    with pytest.raises(OSError, match="No such"):
        is_stopped(held.pid)
