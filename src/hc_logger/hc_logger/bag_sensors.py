"""Which topics of a bag are sensors: a force, and a position; and what to type where that is open.

The joint angles of an arm are no position of a tool: beside a pose they do not count, and alone one
of them is taken only if it is named.
"""

from __future__ import annotations

from itertools import islice
from typing import Final

from hc_logger.bag import Bag
from hc_logger.decoder import decoder
from hc_logger.type_names import FORCE_TYPE, FRAMES_TYPE, JOINT_TYPE, POSITION_TYPES, STATIC

_KINDS: Final = "PoseStamped, TransformStamped, a JointState of one joint, or /tf"

OF_OTHER_TYPES: Final = (
    *("geometry_msgs/msg/Wrench", "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Vector3Stamped"),
    *("geometry_msgs/msg/Pose", "geometry_msgs/msg/Point", "geometry_msgs/msg/PointStamped"),
    *("geometry_msgs/msg/Transform", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    "nav_msgs/msg/Odometry",
)
"""In which drivers tell forces and positions as well, with or without a stamp."""
_NUMBERS: Final = ("std_msgs/msg/Float", "std_msgs/msg/Int", "std_msgs/msg/UInt")
_MOST_NAMED: Final = 3


def force_topics(bag: Bag) -> list[str]:
    """Return the topics of wrenches."""
    return _of_types(bag, (FORCE_TYPE,))


def position_topics(bag: Bag) -> list[str]:
    """Return the topics of positions, those of arms only where no other is; no frames."""
    found = _of_types(bag, POSITION_TYPES)
    if len(found) < 2:
        return found
    return [topic for topic in found if len(joints_of(bag, topic)) < 2] or found


def joints_of(bag: Bag, topic: str) -> list[str]:
    """Return the names of the joints in the first message of a topic; none of another type."""
    definition = bag.topics[topic].definition
    if definition.name != JOINT_TYPE:
        return []
    decode = decoder(definition)
    return [name for m in islice(bag.messages({topic}), 1) for name in decode(m.data).name]


def moving_topics(bag: Bag) -> list[str]:
    """Return the topics of frames that move."""
    return [name for name in _of_types(bag, (FRAMES_TYPE,)) if not name.endswith(STATIC)]


def has_sensors(bag: Bag) -> bool:
    """Whether a bag has exactly one wrench and one position topic, so that neither needs a name."""
    return len(force_topics(bag)) == len(_places(bag)) == 1


def how_to_read(bag: Bag) -> str:
    """Return what a bag lacks to be read by its sensors, or the options that choose among them."""
    forces, places = force_topics(bag), _places(bag)
    if not bag.topics:
        return ""
    if not (forces or places):
        both = f"neither a force ({FORCE_TYPE}) nor a position ({_KINDS})"
        return f"; {both} is among them{_nearly(bag)}"
    if not forces:
        return f"; no force is among them ({FORCE_TYPE}){_nearly(bag)}"
    if not places:
        return f"; no position is among them ({_KINDS}){_nearly(bag)}"
    named = [("force", forces), ("position", places)]
    words = [f"--input {what}.topic={names[0]}" for what, names in named if len(names) > 1]
    return f": several sensors, name them: {' '.join(words)}, say"


def _nearly(bag: Bag) -> str:
    """Return what to do with topics that hold readings in another way, and cannot be read so."""
    others = [
        f"{topic.name} is {topic.definition.name}"
        for topic in bag.topics.values()
        if topic.definition.name in OF_OTHER_TYPES or topic.definition.name.startswith(_NUMBERS)
    ]
    if not others:
        return ""
    return (
        f": {', '.join(others[:_MOST_NAMED])}; let a node publish it as one of these, with the "
        "stamp of the reading, or write a CSV file with time, displacement and force"
    )


def _places(bag: Bag) -> list[str]:
    """Return the topics that may tell a position; frames count where no other is."""
    return position_topics(bag) or moving_topics(bag)


def _of_types(bag: Bag, types: tuple[str, ...]) -> list[str]:
    return [topic.name for topic in bag.topics.values() if topic.definition.name in types]
