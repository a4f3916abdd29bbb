"""Standard output that cannot be written (a full disk): one line, whenever it shows.

With PYTHONUNBUFFERED it shows at any print, where nobody knows what could not be written, and
argparse passes it over. Else it shows when the output is flushed (hc_bringup.cli).
"""

from __future__ import annotations

import io
import os
import sys

from hc_bringup.errors import UserError


class Output(io.TextIOWrapper):
    """A text stream whose writing fails with a line for the user.

    Attributes:
        beneath: the stream whose place this one takes; when that is destroyed it closes the file.
    """

    beneath: io.TextIOWrapper

    def write(self, text: str, /) -> int:
        """Write text.

        Raises:
            BrokenPipeError: if nobody reads it any more.
            UserError: if it cannot be written.
        """
        try:
            return super().write(text)
        except BrokenPipeError:
            raise
        except OSError as error:
            drop()
            raise unwritable(error) from error


def guarded(stream: io.TextIOWrapper) -> Output:
    """Return a stream that writes to the same place in the same way."""
    stream.flush()
    output = Output(
        stream.buffer,
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    output.beneath = stream
    return output


def unwritable(error: OSError) -> UserError:
    """Return what is said of output that cannot be written."""
    return UserError(f"cannot write standard output: {error.strerror}")


def drop() -> None:
    """Drop what is still to be written, so that Python's end is quiet."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
