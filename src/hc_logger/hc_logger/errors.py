"""What can go wrong with a bag, each with a message of one line for the user."""

from __future__ import annotations

from hc_msgs_py.interface_class import UnknownInterfaceError


class BagError(Exception):
    """A bag or recording cannot be read or written; the text says why and what to do."""


class BagExistsError(BagError):
    """The target exists already; nothing is ever overwritten."""


class WrongOptionError(BagError):
    """What was said of how a file is written cannot be, or is not so in this file."""


class ArrayAloneError(BagError):
    """A bag has the samples of a tactile array, and none of one tool."""


class UnknownTypeError(BagError, UnknownInterfaceError):
    """The message type is not installed here, so its definition is not known."""


class MetadataError(BagError):
    """What metadata.yaml says is no use; the bag's files may be whole."""
