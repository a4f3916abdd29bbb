"""metadata.yaml of a bag folder, version 9, as rosbag2 of Jazzy writes it, and reading of any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import yaml

from hc_logger.errors import BagError, MetadataError
from hc_logger.new_file import new_file
from hc_msgs_py.plain_yaml import PlainYamlError, load_plain_yaml, read_plain_yaml

FILE_NAME = "metadata.yaml"
VERSION = 9
ROS_DISTRO = "jazzy"


@dataclass
class TopicRecord:
    """One topic of a bag.

    Attributes:
        name: topic name with leading slash.
        type_name: for example "hc_msgs/msg/IndenterSample".
        type_hash: RIHS01 hash, empty if not known.
        qos_profiles: offered QoS profiles, a list of mappings as rosbag2 has them.
        message_count: messages in the whole bag.
    """

    name: str
    type_name: str
    type_hash: str
    qos_profiles: list[dict[str, Any]]
    message_count: int = 0


@dataclass
class FileRecord:
    """One file of a bag: name, first and last log time (ns), number of messages."""

    path: str
    start_ns: int = 0
    end_ns: int = 0
    message_count: int = 0


@dataclass
class BagMetadata:
    """Content of metadata.yaml."""

    topics: list[TopicRecord]
    files: list[FileRecord]
    custom_data: dict[str, str] = field(default_factory=dict)
    storage: str = "mcap"


def _times(start_ns: int, end_ns: int) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
    }


def bag_information(metadata: BagMetadata) -> dict[str, Any]:
    """Return the mapping that stands below rosbag2_bagfile_information."""
    filled = [f for f in metadata.files if f.message_count] or [FileRecord("")]
    return {
        "version": VERSION,
        "storage_identifier": metadata.storage,
        **_times(min(f.start_ns for f in filled), max(f.end_ns for f in filled)),
        "message_count": sum(f.message_count for f in metadata.files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": topic.qos_profiles,
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.message_count,
            }
            for topic in metadata.topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [f.path for f in metadata.files],
        "files": [
            {"path": f.path, **_times(f.start_ns, f.end_ns), "message_count": f.message_count}
            for f in metadata.files
        ],
        "custom_data": dict(metadata.custom_data) or None,
        "ros_distro": ROS_DISTRO,
    }


def qos_text(profiles: Sequence[Mapping[str, Any]]) -> str:
    """Return QoS profiles as the YAML text that stands in the metadata of an MCAP channel."""
    return yaml.safe_dump([dict(p) for p in profiles], sort_keys=False) if profiles else ""


def information_text(metadata: BagMetadata) -> str:
    """Return the text of the metadata record named rosbag2 inside an MCAP file."""
    return yaml.safe_dump(bag_information(metadata), sort_keys=False)


def write_metadata(folder: Path, metadata: BagMetadata) -> None:
    """Write metadata.yaml in one step, so that a reader never sees half of it.

    Raises:
        OSError: if it cannot be written.
    """
    text = yaml.safe_dump(
        {"rosbag2_bagfile_information": bag_information(metadata)}, sort_keys=False
    )
    with new_file(folder / FILE_NAME, overwrite=True) as file:
        file.write(text.encode())


def remove_metadata(folder: Path) -> None:
    """Delete metadata.yaml."""
    (folder / FILE_NAME).unlink(missing_ok=True)


def parse_yaml(text: str) -> Any:
    """Return the value of a YAML text of a damaged file, None if it is no YAML any more."""
    try:
        return load_plain_yaml(text)
    except PlainYamlError:
        return None


def recorded_hashes(information: Mapping[str, Any]) -> dict[str, str]:
    """Return the type hash of each topic that metadata.yaml names one for."""
    hashes = {}
    for entry in _list(information.get("topics_with_message_count")):
        topic = entry.get("topic_metadata") if isinstance(entry, dict) else None
        if isinstance(topic, dict):
            name, value = topic.get("name"), topic.get("type_description_hash")
            if isinstance(name, str) and isinstance(value, str) and value:
                hashes[name] = value
    return hashes


def recorded_profiles(text: str) -> list[dict[str, Any]]:
    """Return the QoS profiles in a text of a channel or of metadata.yaml; none if it is damaged."""
    return [profile for profile in _list(parse_yaml(text)) if isinstance(profile, dict)]


def recorded_custom_data(information: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts that whoever recorded the bag added."""
    custom = information.get("custom_data")
    if not isinstance(custom, dict):
        return {}
    return {str(k): str(v) for k, v in custom.items() if not isinstance(v, (dict, list))}


def read_information(folder: Path) -> dict[str, Any] | None:
    """Return what stands below rosbag2_bagfile_information, or None without metadata.yaml.

    storage_identifier is a text, relative_file_paths a list of texts, compression_mode a text.

    Raises:
        MetadataError: if the file is not such YAML.
        BagError: if it cannot be read.
    """
    path = folder / FILE_NAME
    if not path.is_file():
        return None
    try:
        content = read_plain_yaml(path)
        information = content["rosbag2_bagfile_information"]
        information.setdefault("compression_mode", "")
        information["compression_mode"] = information["compression_mode"] or ""
        texts = [information["storage_identifier"], information["compression_mode"]]
        names = information["relative_file_paths"]
        if not (isinstance(names, list) and all(isinstance(t, str) for t in (*texts, *names))):
            raise TypeError("a name is no text")
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror}") from error
    except (PlainYamlError, KeyError, TypeError, AttributeError) as error:
        why = str(error) if isinstance(error, (PlainYamlError, TypeError)) else "it lacks entries"
        raise MetadataError(
            f"{path} is damaged ({why}); delete it, or rebuild the bag with: hc bag recover"
        ) from error
    return cast("dict[str, Any]", information)


def is_compressed(information: Mapping[str, Any]) -> bool:
    """Whether rosbag2 compressed the files or the messages of a bag, beside its storage."""
    return information["compression_mode"].lower() in ("file", "message")


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
