"""The page of one run: verdict, charts, tables, and how to make it again."""

from __future__ import annotations

import html
import shlex
from collections.abc import Sequence
from datetime import datetime, timezone
from typing import Any, Final

import numpy as np

from hc_bringup.cut_time import cut_gaps
from hc_bringup.dashboard.columns import COLUMNS, HYPOTHESES
from hc_bringup.dashboard.nis import nis_bands
from hc_bringup.dashboard.palpation import MAP_COLUMNS
from hc_bringup.report.contacts import WORTH_A_ROW, Contact, find_contacts
from hc_bringup.report.page import PANELS, encode_numbers, items, render, table
from hc_bringup.report.palpation_map import DEPTHS_MM, StiffnessMap, usual_depth, usual_map
from hc_bringup.report.rows import column_blocks, map_cells, page_contacts, page_events, page_rows
from hc_bringup.report.verdict import Sentence, settled, verdict
from hc_bringup.run_data import RunData
from hc_bringup.terminal.numbers import decimals_of, engineering, fixed, with_spread
from hc_estimator.stream.readings import Suspicion
from hc_evaluation.channels import ChannelDiagnosis, diagnose_channels, evenly_spaced, unbroken
from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

MOST_CONTACT_ROWS: Final = 200
UNEXPLAINED: Final = 2.0
"""What one law leaves of the force, over its noise: from here on it is no law of this recording."""
UNITS: Final = ("N/mmⁿ", "N(s/mm)ᵖ/mmⁿ", "", "")


def run_page(data: RunData, command: Sequence[str], doubts: Sequence[Suspicion] = ()) -> str:
    """Return the page of a run.

    Args:
        data: the run.
        command: the command line that makes it, for who wants to make it again.
        doubts: what of its readings cannot be right.
    """
    contacts = find_contacts(data, WORTH_A_ROW)
    channels, why_not = _diagnosis(data)
    depth_mm = usual_depth(contacts)
    found = usual_map(data, contacts)
    rows = page_rows(data)
    cell_mm, cells = map_cells(data, rows)
    content = {
        "columns": COLUMNS,
        "rows": len(rows),
        "blocks": {
            name: encode_numbers(values, exact=name in ("time", "sequence"))
            for name, values in column_blocks(rows).items()
        },
        "map_columns": MAP_COLUMNS,
        "cell_mm": cell_mm,
        "cells": encode_numbers(cells, exact=True),
        "cell_count": len(cells),
        "map": None if found is None else {"depth": depth_mm, "lump": _lump(found)},
        "hypotheses": HYPOTHESES,
        "nis_band": nis_bands(),
        "contacts": page_contacts(contacts),
        "events": page_events(data, contacts),
        "truth": data.truth is not None,
        "pieces": _pieces(data),
    }
    said = verdict(data, contacts, channels, found, doubts)
    body = _body(data, said, _map_panel(cells, contacts, depth_mm))
    body += _tables(data, contacts, channels, why_not, command)
    return render(data.title, body, content, PANELS, "report.js")


def _pieces(data: RunData) -> list[tuple[float, float]]:
    """Return begin and end of what lies between gaps so long that one would see nothing else."""
    pieces = cut_gaps(data.time_s).pieces
    return [(piece.start_s, piece.end_s) for piece in pieces] if len(pieces) > 1 else []


def _diagnosis(data: RunData) -> tuple[ChannelDiagnosis | None, str]:
    """Return what stands between the channels, or why that cannot be told."""
    used = data.used
    try:
        # A line drawn across a gap looks late.
        part = unbroken(data.time_s[used], data.displacement_mm[used], data.force_n[used])
        return diagnose_channels(*evenly_spaced(*part)), ""
    except ValueError as error:
        return None, str(error)


def _lump(found: StiffnessMap) -> dict[str, Any] | None:
    """Return the hard spot that is told in words: the map at this depth names the same."""
    lump = found.lump
    if lump is None:
        return None
    place = {"x": lump.x_mm, "y": lump.y_mm}
    return place | {"factor": lump.factor, "deviation": lump.deviation, "passed": lump.passed}


def _body(data: RunData, sentences: Sequence[Sentence], map_panel: str) -> str:
    said = "".join(
        f'<li class="is-{one.level.value}">{html.escape(one.text)}</li>' for one in sentences
    )
    truth = ' <span class="key truth">true</span>' if data.truth is not None else ""
    cards = "".join(
        f'<section class="panel card" id="parameter-{name}"><h2><b>{name}</b>'
        f'<small></small></h2><p class="big"><span class="value">–</span></p><p class="under">'
        f'<span class="unit">{html.escape(unit)}</span><span class="true key truth" hidden></span>'
        '</p><p class="under"><meter class="known" min="0" max="1" low="0.5" high="0.8" '
        f'optimum="1" value="0" aria-label="{name} known from the data"></meter>'
        '<span class="share"></span></p></section>'
        for name, unit in zip("KBnp", UNITS, strict=True)
    )
    wide = "" if map_panel else " full"
    return f"""
<header><h1>{html.escape(data.name)}</h1><p id="headline">{html.escape(data.estimator)}</p>
<div class="tools"><span id="pieces"></span><span id="zoomed" hidden></span>
<button id="whole" type="button" hidden>Whole recording</button>
<button id="theme" type="button" aria-label="light or dark">◐</button></div></header>
<main class="report">
<section class="panel verdict"><h2>In words</h2><ol>{said}</ol></section>
{map_panel}
<section id="depth" class="panel{wide}"><h2>Force over depth</h2><p class="under">
<span class="key measured">measured</span>
<span class="key estimate">law at rest ± 2 sd, at the end of what is shown</span></p></section>
<p class="hint">Drag over a chart to look closer; double-click for the whole.
Curves that a frame cuts go on.
<span class="key estimate">estimate, band of 2 standard deviations</span>{truth}</p>
<section class="cards">{cards}</section>
<section id="force" class="panel"><h2>Force <small>[N]</small></h2><p class="under">
<span class="key measured">measured</span>
<span class="key estimate">foretold one step ahead</span></p></section>
<section id="error" class="panel"><h2>Error one step ahead <small>[mN]</small></h2>
<p class="under">measured minus foretold: least and greatest</p></section>
<section id="nis" class="panel"><h2>Is it honest? <small>mean NIS, ideally 2</small></h2>
<p class="under"><span class="key good">honest; above: it errs more than it admits</span></p>
</section>
<section id="timeline" class="panel"><h2>What happened</h2><div class="lanes"></div>
<p class="under lanes-key"><span class="key good">contact; law fits</span>
<span class="key alarm">law does not fit</span>
leads: colours as in “What the tissue does”</p>
<ol tabindex="0" aria-label="events, latest first"></ol></section>
<section id="hypotheses" class="panel"><h2>What the tissue does</h2><p class="note under"></p>
<div class="hypotheses"></div><p class="faults"></p></section>
"""


def _map_panel(cells: Any, contacts: Sequence[Contact], depth_mm: float) -> str:
    """Return the panel of the map, nothing where there is none."""
    if len(cells) < 2 and len(contacts) < 2:
        return ""
    low, high = DEPTHS_MM
    return (
        '<section id="map" class="panel wide"><h2>Palpation map</h2><p class="under">Stiffness '
        f'where it was felt, at a depth of <label class="inline"><input type="range" min="{low}" '
        f'max="{high:g}" step="0.1" value="{depth_mm}" aria-label="depth of the map in mm"> '
        f"<output>{depth_mm:.1f} mm</output></label> "
        '<span class="scale" hidden><span class="low"></span> <span class="ramp" '
        'aria-hidden="true"></span> <span class="high"></span></span></p>'
        '<p class="under keys" hidden>'
        '<span class="key estimate">stiffness ± 2 sd (standard deviations)</span> '
        '<span class="key tool" hidden>the tool now</span></p><p class="note"></p></section>'
    )


def _tables(
    data: RunData,
    contacts: Sequence[Contact],
    channels: ChannelDiagnosis | None,
    why_not: str,
    command: Sequence[str],
) -> str:
    parts = [
        _section("Parameters at the end", _parameter_table(data), "wide"),
        _section("Figures", _figure_table(data)),
        _section("Between force and displacement", _channel_table(channels, why_not)),
        _section(f"Contacts ({len(contacts)})", _contact_table(contacts), "full"),
        _section("Settings", _settings(data), "wide"),
        _section("How to make it again", _reproduce(data, command)),
    ]
    if data.findings:
        parts.append(_section("About the recording", items(data.findings)))
    return "".join(parts) + "</main>"


def _section(title: str, content: str, css_class: str = "") -> str:
    return f'<section class="panel {css_class}"><h2>{html.escape(title)}</h2>{content}</section>\n'


def _parameter_table(data: RunData) -> str:
    head = ["", "estimate", "± 2 sd", "unit", "known"]
    if data.truth is not None:
        head += ["true", "error"]
    rows = []
    for i, (symbol, unit) in enumerate(zip("KBnp", UNITS, strict=True)):
        value, deviation = data.parameters[-1, i], data.parameters_std[-1, i]
        known = f"{100 * data.identifiability[-1, i]:.0f} %"
        places = decimals_of(value, 2.0 * deviation)
        row = [symbol, fixed(value, places), fixed(2.0 * deviation, places), unit, known]
        if data.truth is not None:
            true = data.truth[-1, i]
            known = np.isfinite(true) and true != 0.0  # it may be missing: nobody waited for it
            row += [fixed(true, places), f"{100 * (value / true - 1):+.2f} %" if known else "–"]
        rows.append(row)
    return table(head, rows, "numbers")


def begins_at(begins_ns: int) -> str:
    """Return a time since 1970 [ns] as date and time of day, by UTC: no recording has a zone."""
    return f"{datetime.fromtimestamp(begins_ns // NANOSECONDS, timezone.utc):%Y-%m-%d %H:%M:%S} UTC"


def _figure_table(data: RunData) -> str:
    chosen = settled(data)
    error = (data.force_n - data.force_predicted_n)[chosen]

    def rms(values: Any) -> str:
        finite = values[np.isfinite(values)]
        return engineering(float(np.sqrt(np.mean(finite**2))), "N") if len(finite) else "–"

    nis = data.nis[chosen]
    nis = nis[np.isfinite(nis)]
    touching = data.contact & data.used
    mismatch = np.mean(data.model_mismatch[touching]) if touching.any() else 0.0
    rows = [
        *([["begins", begins_at(data.begins_ns)]] if data.begins_ns is not None else []),
        ["samples", str(len(data.time_s))],
        ["length", f"{data.time_s[-1] - data.time_s[0]:.2f} s"],
        ["in contact", f"{100 * np.mean(data.contact):.0f} %"],
        ["force error one step ahead, after the first second of contact (RMS)", rms(error)],
        ["the same over the second half", rms(error[len(error) // 2 :])],
        ["mean NIS (ideal 2)", f"{np.mean(nis):.2f}" if len(nis) else "–"],
        ["changes of the tissue", str(int(np.count_nonzero(data.change_detected)))],
        ["contact law did not fit", f"{100 * mismatch:.0f} % of the contact"],
        ["deepest", f"{np.nanmax(data.displacement_mm):.3g} mm"],
        ["largest force", f"{np.nanmax(data.force_n):.3g} N"],
        ["fastest", f"{np.nanmax(np.abs(data.estimates['velocity'])) * METRE_IN_MM:.3g} mm/s"],
    ]
    return table(["", ""], rows)


def _channel_table(channels: ChannelDiagnosis | None, why_not: str) -> str:
    """Say what stands between the channels: it looks like damping and like other exponents."""
    if channels is None:
        return f"<p>Not compared: {html.escape(why_not)}.</p>\n"
    clear = channels.clear_faults
    late = "displacement after force" if channels.delay_s < 0.0 else "force after displacement"
    rows = [
        [what, with_spread(value, 2.0 * deviation), unit, "yes" if name in clear else "no"]
        for name, what, value, deviation, unit in (
            ("delay", late, 1e3 * abs(channels.delay_s), 1e3 * channels.delay_std_s, "ms"),
            ("zero", "force zero", 1e3 * channels.zero_n, 1e3 * channels.zero_std_n, "mN"),
            ("contact", "contact position", channels.contact_mm, channels.contact_std_mm, "mm"),
        )
    ]
    stiffness, damping, exponent, power = channels.parameters
    taken_out = engineering(channels.residual_rms_n, "N")
    left_in = engineering(channels.residual_rms_without_n, "N")
    if channels.residual_rms_n > UNEXPLAINED * channels.noise_n and not channels.explain:
        text = (
            f"One law for the whole recording leaves {left_in} of the force, and {taken_out} "
            "with the three taken out: no fault of the channels explains that. The tissue varies, "
            "changed or relaxes, and these figures say nothing."
        )
    else:
        text = (
            f"One fit to the whole recording, as for one tissue. With the three taken out: "
            f"K = {stiffness:.4g}, B = {damping:.4g}, n = {exponent:.4g}, p = {power:.4g}; force "
            f"residual {taken_out}, left in {left_in}."
        )
    head = ["", "value ± 2 sd", "unit", "stands out"]
    return table(head, rows, "numbers") + f'<p class="under">{html.escape(text)}</p>\n'


def _contact_table(contacts: Sequence[Contact]) -> str:
    if not contacts:
        return "<p>None.</p>"
    place = any(np.isfinite(c.position_mm).all() for c in contacts)
    surfaces = any(np.isfinite(c.surface_mm) and c.surface_mm != 0.0 for c in contacts)
    head = ["", "from [s]", "to [s]", *(["x [mm]", "y [mm]"] if place else [])]
    head += ["surface [mm]"] if surfaces else []
    head += ["depth [mm]", "force [N]", "K", "B", "n", "p", "loss [mJ]", "misfit"]
    rows = []
    for contact in contacts[:MOST_CONTACT_ROWS]:
        row = [str(contact.number), f"{contact.start_s:.2f}", f"{contact.end_s:.2f}"]
        if place:
            row += [f"{v:.1f}" if np.isfinite(v) else "–" for v in contact.position_mm]
        if surfaces:
            row.append(with_spread(contact.surface_mm, 2.0 * contact.surface_std_mm))
        row += [f"{contact.peak_depth_mm:.2f}", f"{contact.peak_force_n:.2f}"]
        row += [
            with_spread(float(value), 2.0 * float(spread))
            for value, spread in zip(contact.parameters, contact.parameters_std, strict=True)
        ]
        row += [f"{contact.energy_loss_mj:.3g}", f"{100 * contact.mismatch_share:.0f} %"]
        rows.append(row)
    more = len(contacts) - MOST_CONTACT_ROWS
    note = '<p class="under">± 2 standard deviations, at the end of each contact.'
    if surfaces:
        note += " K, B, n and p count from its surface, depths from the zero of the position."
    note += f" {more} more: hc contacts writes all of them.</p>" if more > 0 else "</p>"
    return table(head, rows, "numbers") + note


def _settings(data: RunData) -> str:
    rows = [[name, _text(value)] for name, value in sorted(data.settings.items())]
    inside = table(["setting", "value"], rows) if rows else "<p>Not recorded.</p>"
    return f"<details><summary>{len(rows)} settings</summary>{inside}</details>"


def _reproduce(data: RunData, command: Sequence[str]) -> str:
    versions = table(["", ""], [[name, value] for name, value in sorted(data.versions.items())])
    return f"<pre>{html.escape(shlex.join(command))}</pre>{versions}"


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
