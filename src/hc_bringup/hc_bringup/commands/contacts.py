"""hc contacts: one row for each contact of a recording, and the palpation map."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from hc_bringup import recording_input
from hc_bringup.commands import estimate
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import millimetres, newtons, positive, seconds
from hc_bringup.terminal.numbers import counted

HELP = "write one row for each contact of a recording; --map draws the palpation map"
COMPILES = True


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="table of the contacts: .csv or .parquet"
    )
    parser.add_argument(
        "--map",
        dest="maps",
        action="append",
        default=[],
        metavar="MAP",
        help="palpation map by Gaussian-process regression: .png, .svg, .pdf, .csv or .ply; may "
        "be given several times",
    )
    parser.add_argument(
        "--depth", type=positive, metavar="MM", help="depth of the map (default: 2 mm at most)"
    )
    add_rule_options(parser)
    add_sites_option(parser)
    recording_input.add_filter_options(parser, "estimate anew with this filter")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def add_sites_option(parser: argparse.ArgumentParser, *, of_many: bool = False) -> None:
    """Declare --sites, of one recording or of many."""
    beside = "" if of_many else " (of many recordings: hc batch --sites)"
    parser.add_argument(
        "--sites",
        action="store_true",
        help="several places were pressed one after another, each with a surface of its own: where "
        "the tip went sideways by 2 mm between two touches (or was in the air for 1 s, if no "
        f"position is recorded) the surface is looked for and the estimator begins anew{beside}",
    )


def add_rule_options(parser: argparse.ArgumentParser) -> None:
    """Declare what counts as a contact, and where the tip's position is."""
    parser.add_argument(
        "--minimum-depth",
        type=millimetres,
        default=0.0,
        metavar="MM",
        help="shallower touches are left out",
    )
    parser.add_argument(
        "--minimum-force",
        type=newtons,
        default=0.0,
        metavar="N",
        help="weaker touches are left out",
    )
    parser.add_argument(
        "--minimum-duration",
        type=seconds,
        default=0.05,
        metavar="S",
        help="shorter touches are left out (default: 0.05)",
    )
    parser.add_argument(
        "--release", type=seconds, default=0.02, metavar="S", help="so long away, and it is over"
    )
    parser.add_argument(
        "--tip",
        metavar="TOPIC",
        help="position of the tip (default: indenter/tip, or a bag's only pose, transform or "
        "frames; of several frames /tf:tool0, say)",
    )
    parser.add_argument(
        "--tip-axes",
        default="xy",
        choices=("xy", "xz", "yx", "yz", "zx", "zy"),
        help="its components that are sideways (default: xy)",
    )


def contact_rules(arguments: argparse.Namespace) -> Any:
    """Return what counts as a contact (hc_bringup.report.contacts.ContactRules)."""
    from hc_bringup.report.contacts import ContactRules

    return ContactRules(
        minimum_duration_s=arguments.minimum_duration,
        release_s=arguments.release,
        minimum_depth_mm=arguments.minimum_depth,
        minimum_force_n=arguments.minimum_force,
    )


def tip_source(arguments: argparse.Namespace) -> Any:
    """Return where the tip's position is (hc_bringup.tip_path.TipSource), None: where usual."""
    from hc_bringup.tip_path import TipSource

    if arguments.tip is None and arguments.tip_axes == "xy":
        return None
    return TipSource(arguments.tip or "", arguments.tip_axes)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.report.contact_file import encode, has_known_suffix
    from hc_bringup.report.contacts import find_contacts
    from hc_bringup.report.map_file import SUFFIXES
    from hc_bringup.run_data import estimated, recorded
    from hc_bringup.standard_input import name_of
    from hc_bringup.unusable import say_unread, say_unusable

    targets = [Path(name) for name in (arguments.output, *arguments.maps) if name is not None]
    if not targets:
        raise UserError(
            "give a table with -o OUT.csv, a map with --map MAP.png, or both", WRONG_USE
        )
    if arguments.output is not None and not has_known_suffix(Path(arguments.output)):
        raise UserError(f"{arguments.output} must end in .csv or .parquet", WRONG_USE)
    for name in arguments.maps:
        if Path(name).suffix.lower() not in SUFFIXES:
            raise UserError(f"{name} must end in {', '.join(SUFFIXES)}", WRONG_USE)
    if arguments.depth is not None and not arguments.maps:
        raise UserError("--depth is of the map: name one with --map", WRONG_USE)
    for target in targets:
        if target.exists():
            raise UserError(f"{target} exists already: choose another file", WRONG_USE)
    recording = recording_input.load(arguments)
    if arguments.maps and not recording.is_bag and arguments.output is None:
        raise UserError(_no_place(name_of(arguments)), WRONG_USE)
    say_unread(name_of(arguments), recording)
    wrong = say_unusable(name_of(arguments), recording)
    tip = tip_source(arguments)
    beside: dict[str, Any] = {}
    delay: Any = None
    data: Any
    if arguments.sites:
        from hc_bringup.sites import run_by_site

        found = run_by_site(recording, tip, lambda part: estimate.make_estimator(arguments, part))
        data, delay = found.data, found.delay
    elif estimate.is_asked_for(arguments) or (data := recorded(recording, tip)) is None:
        data = estimated(recording, estimate.make_estimator(arguments, recording), tip)
    contacts = find_contacts(data, contact_rules(arguments))
    if arguments.sites:
        beside = found.columns(contacts)
    written = []
    if arguments.output is not None:
        written.append(
            _write(Path(arguments.output), encode(contacts, targets[0].suffix.lower(), beside))
        )
    summary: dict[str, Any] = {"contacts": len(contacts)}
    if beside:
        summary["sites"] = _of_sites(beside, contacts)
    if delay is not None:
        summary |= {"channel_delay_s": delay.seconds, "channel_delay_std_s": delay.deviation_s}
    summary["written"] = written
    try:
        if arguments.maps and not recording.is_bag:
            raise UserError(_no_place(name_of(arguments)))
        if arguments.maps:
            summary |= _write_maps(arguments, data, contacts, written)
    finally:  # where no map can be drawn, the table is there all the same
        if written:
            _tell(summary, as_json=arguments.json)
    if wrong:
        raise UserError(f"{name_of(arguments)}: {wrong}: do what stands above")
    return 0


def _no_place(name: str) -> str:
    return (
        f"{name} is a CSV file, which tells no place: a map needs a bag with the tip's position "
        "(hc record); a CSV has a table of its contacts, -o OUT.csv"
    )


def _of_sites(beside: dict[str, list[Any]], contacts: list[Any]) -> list[dict[str, Any]]:
    """Return what is known of each place in the end, with the last of its contacts."""
    from hc_bringup.sites import SITE
    from hc_estimator import PARAMETER_NAMES

    last = dict(zip(beside[SITE], range(len(contacts)), strict=True))
    return [
        {
            "site": number,
            "x_mm": float(contacts[i].position_mm[0]),
            "y_mm": float(contacts[i].position_mm[1]),
            "surface_mm": beside["surface [mm]"][i],
            "surface_std_mm": beside["surface_std [mm]"][i],
            "parameters": dict(zip(PARAMETER_NAMES, contacts[i].parameters.tolist(), strict=True)),
            "parameters_std": dict(
                zip(PARAMETER_NAMES, contacts[i].parameters_std.tolist(), strict=True)
            ),
        }
        for number, i in last.items()
    ]


def _write_maps(
    arguments: argparse.Namespace, data: Any, contacts: list[Any], written: list[str]
) -> dict[str, Any]:
    import numpy as np

    from hc_bringup.report import map_file
    from hc_bringup.report.palpation_map import (
        fit_map,
        measured_places,
        pressed_mm,
        usual_depth,
    )

    depth = arguments.depth or usual_depth(contacts)
    deepest = [
        pressed_mm(contact) for contact in contacts if np.isfinite(contact.position_mm).all()
    ]
    if arguments.depth is not None and deepest and depth > max(deepest):
        most = math.floor(100.0 * max(deepest)) / 100.0
        raise UserError(
            f"--depth {depth:g}: no contact went deeper than {most:g} mm, and beyond that nothing "
            "was measured; give less",
            WRONG_USE,
        )
    found = fit_map(measured_places(data, contacts, depth))
    axes = data.tip.axes if data.tip is not None else "xy"
    for name in arguments.maps:
        written.append(_write(Path(name), map_file.encode(found, Path(name), data.title, axes)))
    summary: dict[str, Any] = {
        "places": len(found.places.log_stiffness),
        "depth_mm": depth,
        "shallower_contacts": sum(one < depth for one in deepest),
        "length_mm": list(found.length_mm),
    }
    if found.lump is not None:
        lump = found.lump
        summary["lump"] = {
            "x_mm": lump.x_mm,
            "y_mm": lump.y_mm,
            "times_as_stiff": lump.factor,
            "times_as_stiff_std": lump.deviation,
            "passed": lump.passed,
            "in_words": lump.sentence(found.is_line),
        }
    return summary


def _write(path: Path, content: bytes) -> str:
    from hc_logger.new_file import new_file

    try:
        with new_file(path) as file:
            file.write(content)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
    return str(path)


def _tell(summary: dict[str, Any], *, as_json: bool) -> None:
    from hc_bringup.summary import to_json

    if as_json:
        print(to_json(summary))
        return
    print(counted(summary["contacts"], "contact"))
    for site in summary.get("sites", ()):
        values = ", ".join(
            f"{symbol} = {value:.4g} ± {deviation:.2g}"
            for symbol, value, deviation in zip(
                "KBnp", site["parameters"].values(), site["parameters_std"].values(), strict=True
            )
        )
        x_mm, y_mm = site["x_mm"], site["y_mm"]
        where = "" if math.isnan(x_mm) else f", at x = {x_mm:.1f}, y = {y_mm:.1f} mm"
        print(
            f"site {site['site']}: surface at {site['surface_mm']:.6g} ± "
            f"{site['surface_std_mm']:.1g} mm, {values}{where}"
        )
    if "channel_delay_s" in summary:
        _tell_delay(summary["channel_delay_s"], summary["channel_delay_std_s"])
    if "places" in summary:
        print(f"map of {summary['places']} places, stiffness at {summary['depth_mm']:g} mm")
        if few := summary["shallower_contacts"]:
            print(
                f"{few} of the contacts went less deep: there the map says what their laws would "
                "be at that depth"
            )
    lump = summary.get("lump")
    if lump is not None:
        print(lump["in_words"])
    for name in summary["written"]:
        print(f"written: {name}")


def _tell_delay(seconds: float, deviation_s: float) -> None:
    from hc_bringup.place_delay import Delay

    delay = Delay(seconds, deviation_s, 0)
    if abs(seconds) < 3.0 * deviation_s:
        print(f"force and position are in step, to {1e3 * deviation_s:.1g} ms at all sites")
        return
    print(f"{delay.late}, at all sites alike")
    print(f"  for a node that runs: hc param set estimator channel_delay {seconds:.4f}")
