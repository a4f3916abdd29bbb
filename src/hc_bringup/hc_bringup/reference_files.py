"""The page of file formats: what is read and written, columns as the programs have them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from hc_bringup.batch.sources import MANIFEST
from hc_bringup.batch.tables import CONTACTS, RECORDINGS, SITES, table_columns
from hc_bringup.estimate_table import COLUMNS as ESTIMATE_COLUMNS
from hc_bringup.report import contact_file, map_file
from hc_estimator.stream.state_file import RUNNING, SAVED, SET_ASIDE
from hc_logger.csv_layout import COLUMNS as RECORDING_COLUMNS

_PAGE: Final = """# Files

{written}

Tables are UTF-8, with commas, points in numbers and one line of names; what is not known stays
empty. Times are in s, forces in N; lengths in files are in mm, on topics in m. K (`stiffness`)
is in N/mm^n, B (`damping`) in N (s/mm)^p / mm^n.

## Recording (CSV)

Read by `hc estimate`, `hc report`, `hc doctor` and others, in many layouts
([your own robot](../guide/own_robot.md)); written by `hc simulate` and `hc bag convert`:

{recording}

## Estimates (CSV, compressed or not, parquet)

`hc estimate RECORDING -o OUT.csv`, a row for each sample:

{estimates}

## Contacts (CSV, parquet)

`hc contacts RECORDING -o FILE` ({contact_suffixes}), a row for each contact:

{contacts}

## Map (picture, CSV, mesh)

`hc contacts RECORDING --map FILE` ({map_suffixes}). As CSV, a row for each place:

{map}

## Batch

`hc batch` leaves `{manifest}` (what was done with what, with the hash of every file) and two
tables, with `--sites` three, each as CSV and parquet. `{recordings_name}`:

{recordings}

`{contacts_name}` has the first six of these, then the columns of a contact above. A column
`sweep NAME` stands for each setting that is swept ([batches](../batch.md)). With `--sites` the last
column is `site [1]`, and `{sites_name}` has a row for each place:

{sites}

## Motion of a hand (CSV)

Read by `hc run master --param master.motion=FILE.csv` ([teleoperation](../teleoperation.md));
`lateral_mm` may be missing:

```
time_s, displacement_mm, lateral_mm
```

## Bag (MCAP)

`hc run`, `hc record`, `hc simulate` and node `recorder` write folders with `metadata.yaml` and
files `.mcap`, as rosbag2 does, of the messages in [topics](topics.md) ([bags](../bags.md)).

## Scenario and parameters (YAML)

A scenario of the rig: [scenario.schema.json](scenario.schema.json). Parameters of the nodes, as
ROS 2 reads them: [parameters.schema.json](parameters.schema.json). Editors check files by both.

## State of the estimator (JSON)

In `state.folder`: `{saved}` (`hc save`), `{running}` (kept while the node runs, removed at
a clean end), `{set_aside}` (a state that ended the process) ([the estimator node](../node.md)).
"""


def files_page(written: str) -> str:
    """Every kind of file, by the command that reads or writes it.

    Args:
        written: the line that says how the page is made.
    """
    batch = table_columns((), sites=True)
    return _PAGE.format(
        written=written,
        recording=_columns(RECORDING_COLUMNS),
        estimates=_columns(ESTIMATE_COLUMNS.split(",")),
        contact_suffixes=", ".join(contact_file.SUFFIXES),
        contacts=_columns(contact_file.columns([])),
        map_suffixes=", ".join(map_file.SUFFIXES),
        map=_columns(map_file.COLUMNS),
        manifest=MANIFEST,
        recordings_name=RECORDINGS,
        recordings=_columns(batch[RECORDINGS]),
        contacts_name=CONTACTS,
        sites_name=SITES,
        sites=_columns(batch[SITES]),
        saved=SAVED,
        running=RUNNING,
        set_aside=SET_ASIDE,
    )


def _columns(names: Iterable[str]) -> str:
    """The names as a block of code, some on a line."""
    lines, line = ["```"], ""
    for name in names:
        if line and len(line) + len(name) > 96:
            lines.append(f"{line},")
            line = ""
        line += f", {name}" if line else name
    return "\n".join([*lines, line, "```"])
