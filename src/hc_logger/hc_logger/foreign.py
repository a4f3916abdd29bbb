"""Opens any bag that is there: our own, and those of others (foreign_bag.py)."""

from __future__ import annotations

import os
from pathlib import Path

from hc_logger.bag import Bag, Topic
from hc_logger.errors import BagError
from hc_logger.metadata import is_compressed, read_information
from hc_logger.reader import BagReader
from hc_logger.selection import full_name
from hc_msgs_py.topics import ESTIMATE, ESTIMATES, SAMPLE, SAMPLES


def open_bag(path: str | os.PathLike[str], namespace: str = "") -> Bag:
    """Open a bag of any kind that is supported.

    Args:
        path: bag folder or MCAP file.
        namespace: of the arm that is looked at, as /left; empty for all topics.

    Raises:
        BagError: if there is none.
    """
    bag = _opened(Path(path))
    if namespace:
        bag.namespace, bag.topics = namespace, _of_arm(bag.topics, namespace)
    return bag


def _of_arm(topics: dict[str, Topic], namespace: str) -> dict[str, Topic]:
    """Return the topics without those in the namespaces of other arms."""
    usual = {full_name(name) for name in (SAMPLE, SAMPLES, ESTIMATE, ESTIMATES)}
    own = f"{namespace}/"
    spaces = {own} | {
        f"{name.removesuffix(ending)}/"
        for name in topics
        for ending in usual
        if name.endswith(ending) and name != ending
    }

    def is_of_another(name: str) -> bool:
        return max((s for s in spaces if name.startswith(s)), key=len, default=own) != own

    return {name: topic for name, topic in topics.items() if not is_of_another(name)}


def _opened(path: Path) -> Bag:
    if path.is_dir():
        information = read_information(path)
        if information is not None and (
            information["storage_identifier"] != "mcap" or is_compressed(information)
        ):
            # rosbags takes a third of a second to load, which who reads a table need not wait for.
            from hc_logger.foreign_bag import ForeignBag

            return ForeignBag(path)
        if information is None and any(path.glob("*.db3*")) and not any(path.glob("*.mcap")):
            raise BagError(
                f"{path} has .db3 files and no metadata.yaml, as a recorder leaves it that was "
                f"killed; ros2 bag reindex {path} writes it"
            )
    elif path.suffix == ".db3":
        raise BagError(f"{path}: give the folder of the bag, with its metadata.yaml")
    return BagReader(path)
