"""A whole batch: plans it, has it done, gathers tables, manifest and page from the results.

What is in the folder at the end depends on recordings, settings and software only: not on the
number of workers, nor on how often it was interrupted and taken up again.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import json
import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from hc_bringup.batch import tables
from hc_bringup.batch.software import software_stamp, software_versions
from hc_bringup.batch.sources import MANIFEST
from hc_bringup.batch.tables import Done
from hc_bringup.batch.variants import Variant
from hc_bringup.batch.work import Answer, ResultError, Task, read_result
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.estimate_table import has_pyarrow
from hc_bringup.named_lock import owner_of, take
from hc_bringup.plain_json import finite
from hc_logger.new_file import new_file

PAGE: Final = "overview.html"
TASKS_PER_WORKER: Final = 4
"""At least so many, where recordings are few and variants many."""
_LEFT_OVER: Final = re.compile(r"\..+\.[0-9a-f]{16}")
"""What a killed process leaves of a file that it was writing (hc_logger.new_file)."""

Engine = Callable[[Iterable[Task]], Iterator[Answer]]


@dataclasses.dataclass
class Campaign:
    """A batch.

    Attributes:
        folder: of the results.
        paths: of the recordings.
        names: of them in the tables.
        variants: ways to estimate.
        arguments: options that say how recordings are read and what counts as a contact.
        estimates: format of the full estimates, empty for none.
        resume: whether results that are there are kept.
        command: the command line that makes the same results.
        reading: the part of it that says how recordings are read and what counts as a contact.
        answers: to the tasks that were done, by recording: content, size and keys.
        made: results made by this run that have numbers.
        complete: whether every task was done.
    """

    folder: Path
    paths: Sequence[Path]
    names: Sequence[str]
    variants: Sequence[Variant]
    arguments: argparse.Namespace
    estimates: str
    resume: bool
    command: Sequence[str]
    reading: Sequence[str]
    answers: dict[int, Answer] = dataclasses.field(default_factory=dict)
    made: int = 0
    complete: bool = False

    @property
    def total(self) -> int:
        """How many results there will be."""
        return len(self.paths) * len(self.variants)

    @property
    def done(self) -> int:
        """How many there are."""
        return sum(len(answer.keys) for answer in self.answers.values())

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Make the folder, and have it for this process: of two, one would replace all tables.

        Raises:
            UserError: if it is a file, cannot be made, or another process works in it.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise UserError(f"{self.folder} is a file: choose another folder", WRONG_USE)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            found = self.folder.stat()
        except OSError as error:
            raise UserError(f"cannot make {self.folder}: {error.strerror or error}") from error
        name = f"hc_batch_in_folder_{found.st_dev}_{found.st_ino}"
        lock = take(name)
        if lock is None:
            raise UserError(
                f"{owner_of(name)[1]} works in {self.folder}, and the tables of two would replace "
                "each other: wait for its end, or choose another folder"
            )
        with lock:
            yield

    def prepare(self) -> None:
        """See what is in the folder, and say there what this is.

        Raises:
            UserError: if it holds something else, the results of another study, or results and
                they are not to be kept.
        """
        if self.folder.is_dir() and any(self.folder.iterdir()):
            if not (self.folder / MANIFEST).is_file():
                raise UserError(
                    f"{self.folder} holds something else: choose another folder", WRONG_USE
                )
            if not self.resume:
                raise UserError(
                    f"{self.folder} holds a batch already: go on with it by --resume, "
                    "or choose another folder",
                    WRONG_USE,
                )
            self._check_study()
        self._write_manifest({})

    def _check_study(self) -> None:
        """See that what is in the folder will be a part of what is made now.

        Raises:
            UserError: if it is of other variants, or of recordings that are read in another way.
        """
        try:
            there = json.loads((self.folder / MANIFEST).read_bytes())
            before = [_settings(variant) for variant in there["variants"]]
            command = shlex.join(there["command"])
            reading = there.get("reading", list(self.reading))  # older ones do not say it
        except (OSError, ValueError, TypeError, KeyError, AttributeError):
            return  # it was cut off: nothing can be said of it
        now = [_settings(variant) for variant in json.loads(self._variants_as_text())]
        if reading != list(self.reading) or any(variant not in now for variant in before):
            raise UserError(
                f"{self.folder} holds another study, whose tables would be replaced: choose "
                f"another folder, or go on with that one: {command}",
                WRONG_USE,
            )

    def _variants_as_text(self) -> str:
        variants = [{"label": one.label, **one.configuration} for one in self.variants]
        return json.dumps(finite(variants), allow_nan=False)

    def tasks(self, workers: int) -> list[Task]:
        """Return what is to be done.

        Args:
            workers: that share it.
        """
        shares = -(-TASKS_PER_WORKER * workers // len(self.paths))
        size = -(-len(self.variants) // min(shares, len(self.variants)))
        numbered = list(enumerate(self.variants))
        groups = [tuple(numbered[i : i + size]) for i in range(0, len(numbered), size)]
        fixed = (self.arguments, self.folder, self.estimates, self.resume, software_stamp())
        return [
            Task(number, path, group, *fixed)
            for number, path in enumerate(self.paths)
            for group in groups
        ]

    def run(self, engine: Engine, tasks: Sequence[Task], tell: Callable[[int, int], None]) -> None:
        """Do the tasks; whatever ends this early, what is done is kept.

        Args:
            engine: does tasks.
            tasks: of `tasks`.
            tell: is told what is done and how much there is in all.

        Raises:
            ResultError: if a result cannot be written.
        """
        tell(0, self.total)
        with contextlib.closing(engine(tasks)) as answers:  # type: ignore[type-var]
            for answer in answers:
                self.made += answer.made
                before = self.answers.get(answer.number)
                if before is not None:  # the same recording through other variants
                    known = before if before.content else answer
                    answer = dataclasses.replace(known, keys=before.keys | answer.keys)
                self.answers[answer.number] = answer
                tell(self.done, self.total)
        self.complete = self.done == self.total

    def results(self) -> Iterator[Done]:
        """Yield the results in their order.

        Raises:
            ResultError: if one that was made cannot be read.
        """
        for number in sorted(self.answers):
            answer = self.answers[number]
            for variant in sorted(answer.keys):
                key = answer.keys[variant]
                try:
                    result = read_result(self.folder, key)
                except (OSError, ValueError) as error:
                    raise ResultError(f"a result is gone from {self.folder}: {error}") from error
                yield Done(
                    self.names[number],
                    answer.content,
                    answer.size,
                    self.variants[variant],
                    key,
                    result,
                )

    def copies(self) -> list[list[str]]:
        """Return the names of recordings with the same content, those of each together."""
        of: dict[str, list[str]] = {}
        for number, answer in sorted(self.answers.items()):
            if answer.content and answer.size:
                of.setdefault(answer.content, []).append(self.names[number])
        return [names for names in of.values() if len(names) > 1]

    def gather(self) -> list[str]:
        """Write tables, page and manifest; returns the names of the files.

        Raises:
            ResultError: if one cannot be written.
        """
        from hc_bringup.report.batch_page import batch_page

        if self.complete:  # else somebody may still be writing
            self._clean()
        swept = list(self.variants[0].swept)
        written = []
        rows_of = {
            tables.RECORDINGS: tables.recording_rows,
            tables.CONTACTS: tables.contact_rows,
            tables.SITES: tables.site_rows,
        }
        tables_now = tables.table_columns(swept, sites=self.arguments.sites)
        for table in rows_of.keys() - tables_now.keys():  # of an earlier run, and of other results
            for suffix in (".csv", ".parquet"):
                (self.folder / f"{table}{suffix}").unlink(missing_ok=True)
        for table, kinds in tables_now.items():
            names = [f"{table}.csv", f"{table}.parquet"]
            for name in names:
                rows = (row for done in self.results() for row in rows_of[table](done, swept))
                if name.endswith(".csv"):
                    tables.write_csv(self.folder / name, kinds, rows)
                elif not has_pyarrow():
                    (self.folder / name).unlink(missing_ok=True)  # of an earlier run
                    continue
                else:
                    tables.write_parquet(self.folder / name, kinds, rows)
                written.append(name)
        page = batch_page(self.results(), self.variants, self.command, complete=self.complete)
        self._write(PAGE, page.encode("utf-8", "replace"))
        written.append(PAGE)
        self._write_manifest({name: _hash_of(self.folder / name) for name in written})
        return [*written, MANIFEST]

    def _write_manifest(self, files: dict[str, str]) -> None:
        manifest = {
            "format": 1,
            "command": list(self.command),
            "complete": self.complete,
            "software": {"stamp": software_stamp(), **software_versions()},
            "reading": list(self.reading),
            "variants": json.loads(self._variants_as_text()),
            "recordings": [
                {
                    "recording": self.names[number],
                    "sha256": answer.content,
                    "bytes": answer.size,
                    "results": [answer.keys[variant] for variant in sorted(answer.keys)],
                }
                for number, answer in sorted(self.answers.items())
            ],
            "files": files,
        }
        text = json.dumps(finite(manifest), indent=1, allow_nan=False)
        self._write(MANIFEST, text.encode() + b"\n")

    def _write(self, name: str, content: bytes) -> None:
        try:
            with new_file(self.folder / name, overwrite=True) as file:
                file.write(content)
        except OSError as error:
            path = self.folder / name
            raise ResultError(f"cannot write {path}: {error.strerror or error}") from error

    def _clean(self) -> None:
        """Remove what killed workers left of files that they were writing."""
        for part in ("results", "estimates"):
            for folder, _, files in os.walk(self.folder / part):
                for name in files:
                    if _LEFT_OVER.fullmatch(name):
                        Path(folder, name).unlink(missing_ok=True)


def _settings(variant: dict[str, object]) -> dict[str, object]:
    """Return a variant of a manifest without its name."""
    return {name: value for name, value in variant.items() if name != "label"}


def _hash_of(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1024 * 1024):
            digest.update(block)
    return digest.hexdigest()
