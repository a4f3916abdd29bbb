"""The end of a run on the command line: the summary, and whether it counts as a success."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hc_bringup.errors import FAILURE, UserError
from hc_bringup.run_state import RunState
from hc_bringup.summary import run_summary, run_text, to_json, why_unusable
from hc_bringup.wrapping import say, wrapped
from hc_logger.errors import BagError
from hc_logger.metadata import FILE_NAME, read_information
from hc_logger.numbered_bags import numbered_bags
from hc_logger.selection import full_name
from hc_msgs_py.diagnostics import number_said
from hc_msgs_py.topics import ESTIMATE, NODE_RECORDER

LONGEST_WITHOUT_ESTIMATE_S = 1.0
_OF_NODES = ("diagnostics", "rosout", "parameter_events", "configuration")
"""Ends of the topics that nodes publish without a sample."""


def conclude(
    state: RunState, node_names: list[str], bag: Path | None, *, as_json: bool, with_latency: bool
) -> Path | None:
    """Print the summary of a run; returns the folder of its first bag.

    Args:
        state: the run at its end.
        node_names: the nodes of its plan.
        bag: folder that the recorder was given, or None; another run may have had it first.
        as_json: whether to print JSON.
        with_latency: False where the stamps are not of the time of publication (a replay).

    Raises:
        UserError: after printing, if the run went on to its end and failed all the same.
    """
    for one in (state, *state.others):
        if one.estimator in node_names:
            whose = f"{one.estimator}: " if state.others else ""
            state.failures += [f"{whose}{reason}" for reason in _why_failed(one)]
    bags = []
    if bag is not None:
        state.dropped = {name: n for name, n in state.dropped.items() if _is_of(bag, name)}
        missing = _missing_at_the_end(state)
        if missing and state.dropped:
            state.dropped[list(state.dropped)[-1]] += missing
        bags = list(state.dropped) or [str(folder) for folder in numbered_bags(bag)] or [str(bag)]
        bags = [_where_now(name, state.diagnostics.get(NODE_RECORDER, {})) for name in bags]
    first = bags[0] if bags else None
    cut = "; ".join(f"{bag} was {how}" for bag in bags if (how := _how_to_close(Path(bag))))
    summary = run_summary(state, first, bags[1:], with_latency=with_latency)
    if as_json:
        print(to_json(summary))
    else:
        say(run_text(summary))
    if state.failures:
        raise UserError("; ".join([*state.failures, cut] if cut else state.failures), FAILURE)
    if cut:  # of a recorder that died and was started again
        print(wrapped(cut, stream=sys.stderr), file=sys.stderr)
    return None if first is None else Path(first)


def _missing_at_the_end(state: RunState) -> int:
    """Count the estimates behind the last one that the recorder got.

    What is missing before a message is seen by its number. Of a recorder that stood still when the
    run ended (a disk that hangs, Ctrl-Z) the last messages have none behind them.
    """
    said = state.diagnostics.get(NODE_RECORDER, {})
    if not number_said(said, "closed") or number_said(said, "unwritten") or state.respawns:
        return 0  # its last counts are unknown, or those of a part, or it says itself why
    missing = 0
    for one in (state, *state.others):
        topic = full_name(ESTIMATE, f"/{one.estimator.rpartition('/')[0]}")
        messages = number_said(said, f"{topic} messages")
        if messages > 0.0:  # of batches of estimates there are none on this topic
            got = messages + number_said(said, f"{topic} dropped")
            missing += max(0, one.statistics.estimates - int(got))
    return missing


def _where_now(name: str, said: dict[str, str]) -> str:
    """Return the folder of a bag, which somebody may have renamed while it was recorded.

    Args:
        name: the folder that was made.
        said: what the recorder said of itself last.
    """
    moved = said.get("bag") == name and not Path(name).exists()
    return said.get("folder", name) if moved else name


def _is_of(bag: Path, name: str) -> bool:
    """Whether a bag is one of this run's: its own, or one with a number behind the name.

    A recorder that somebody else started is called as that of the run, and tells its bag as well.
    """
    number = Path(name).name.removeprefix(bag.name)
    return Path(name).parent == bag.parent and (not number or number[1:].isdecimal())


@contextmanager
def naming_bag(bag: Path | None, given: str | None) -> Iterator[None]:
    """Say of a run that fails in here where the bag is that it leaves.

    One that holds nothing but what the nodes said of themselves at their start is removed.

    Args:
        bag: folder that the recorder was given, or None.
        given: what the user said of it, nothing for a folder with the date.

    Raises:
        UserError: what was raised in here, and the bag if there is one.
    """
    try:
        yield
    except UserError as error:
        bags = [] if bag is None else numbered_bags(bag)
        if bags:
            left = bags[-1]
            if _holds_no_data(left):
                shutil.rmtree(left)
                raise
            how = _how_to_close(left)
            whole = f" ({how})" if how else ""
            again = "; take another --bag to try again" if given else ""
            error.args = (f"{error}; what was recorded is in {left}{whole}{again}",)
        raise


def _how_to_close(bag: Path) -> str:
    """Say what makes a bag whole whose recorder could not end it; empty if it is."""
    if (bag / FILE_NAME).exists() or not bag.is_dir():
        return ""
    return f"not closed: hc bag recover {shlex.quote(str(bag))} NEW makes it whole"


def _holds_no_data(bag: Path) -> bool:
    """Whether a bag was closed, and no message in it is of a sensor or of an estimate."""
    try:
        information = read_information(bag)
    except BagError:
        return False
    if information is None or set(bag.glob("*")) - {bag / FILE_NAME, *bag.glob("*.mcap")}:
        return False
    return all(
        topic["topic_metadata"]["name"].rpartition("/")[2] in _OF_NODES
        for topic in information["topics_with_message_count"]
        if topic["message_count"]
    )


def _why_failed(state: RunState) -> list[str]:
    """Say why what an estimator says is nothing or of no use; empty if it is neither."""
    statistics = state.statistics
    misfit = statistics.mismatch / max(statistics.estimates, 1)
    wrong = why_unusable((name.partition(" of ")[0] for name in state.suspicions), misfit)
    advice = f"{wrong}: do what stands above them, or see hc doctor" if wrong else ""
    return [reason for reason in (_why_no_estimate(state), _why_mixed(state), advice) if reason]


def _why_mixed(state: RunState) -> str:
    """Say that another estimator told its estimates on the same topic; empty if none did."""
    if not state.statistics.mixed:
        return ""
    return (
        f"estimates of another estimator of the name {state.estimator} came among these, and the "
        "figures are of both: end the other, or give it a namespace (-r __ns:=/left) or a domain "
        "(ROS_DOMAIN_ID)"
    )


def _why_no_estimate(state: RunState) -> str:
    """Say why a run has no result, empty if it has one."""
    if state.statistics.estimates or state.elapsed_s < LONGEST_WITHOUT_ESTIMATE_S:
        return ""
    said = state.problems.get(state.estimator) or state.silent_reason
    if state.samples:
        return f"no estimate came of {state.samples} samples" + (f": {said}" if said else "")
    if state.messages:
        return f"no estimate came of {state.messages} messages" + (f": {said}" if said else "")
    return (
        f"no estimate came in {state.elapsed_s:.0f} s: "
        f"{said or 'does anybody publish samples? (hc topic list)'}"
    )
