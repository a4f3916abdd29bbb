"""hc report: pictures and tables of a recording in one HTML file, or the picture alone."""

from __future__ import annotations

import argparse
import base64
import html
import io
from pathlib import Path
from typing import Any

from hc_bringup import recording_input
from hc_bringup.commands import estimate
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import assignment

HELP = "draw a recording and its estimates into an HTML page or a picture"
_PICTURES = (".png", ".svg", ".pdf")
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font-family: sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em; color: #222 }}
img {{ width: 100% }}
table {{ border-collapse: collapse; margin: 1em 0 }}
td, th {{ border-bottom: 1px solid #ddd; padding: .3em .8em; text-align: right }}
td:first-child, th:first-child {{ text-align: left }}
</style></head><body>
<h1>{title}</h1>
<img alt="force, parameters and consistency over time" src="data:image/png;base64,{picture}">
{tables}
</body></html>
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="page (.html) or .png, .svg, .pdf"
    )
    parser.add_argument(
        "--filter", metavar="F", help="estimate anew with this filter (default: as recorded)"
    )
    parser.add_argument("--state-space", metavar="S", help="the same, with this state space")
    parser.add_argument("--contact-model", metavar="M", help="the same, with this contact law")
    parser.add_argument(
        "--param",
        type=assignment,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="the same, with this setting; may be given several times",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.picture import draw
    from hc_bringup.run_data import estimated, recorded
    from hc_logger.new_file import new_file

    target = Path(arguments.output)
    if target.suffix.lower() not in (".html", *_PICTURES):
        raise UserError(f"{target} must end in .html, {', '.join(_PICTURES)}", WRONG_USE)
    if target.exists():
        raise UserError(f"{target} exists already: choose another file", WRONG_USE)
    recording = recording_input.load(arguments)
    anew = any(
        (
            arguments.filter,
            arguments.state_space,
            arguments.contact_model,
            arguments.param,
            recording_input.is_given(arguments),
        )
    )
    data = None if anew else recorded(recording)
    if data is None:
        data = estimated(recording, estimate.make_estimator(arguments))
    figure = draw(data)
    kind = target.suffix.lower().removeprefix(".")
    if kind == "html":
        content = _page(data, figure, recording.findings.lines()).encode("utf-8", "replace")
    else:
        picture = io.BytesIO()
        figure.savefig(picture, format=kind, dpi=110)
        content = picture.getvalue()
    try:
        with new_file(target) as file:
            file.write(content)
    except OSError as error:
        raise UserError(f"cannot write {target}: {error.strerror or error}") from error
    print(f"written: {target}")
    return 0


def _page(data: Any, figure: Any, findings: list[str]) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    return _PAGE.format(
        title=html.escape(data.title),
        picture=base64.b64encode(buffer.getvalue()).decode("ascii"),
        tables=_parameter_table(data)
        + _figure_table(data)
        + _channel_table(data)
        + _list(findings),
    )


def _parameter_table(data: Any) -> str:
    from hc_bringup.live import SYMBOLS

    head = ["parameter", "estimate at the end", "± 1 sd", "unit"]
    if data.truth is not None:
        head += ["true", "error"]
    rows = []
    for index, (symbol, unit) in enumerate(SYMBOLS.values()):
        value, deviation = data.parameters[-1, index], data.parameters_std[-1, index]
        row = [symbol, f"{value:.5g}", f"{deviation:.2g}", unit or "1"]
        if data.truth is not None:
            true = data.truth[-1, index]
            row += [f"{true:.5g}", f"{100 * (value / true - 1):.2f} %"]
        rows.append(row)
    return _table(head, rows)


def _figure_table(data: Any) -> str:
    import numpy as np

    contact = data.displacement_mm > 0.0
    elapsed = data.time_s - (data.time_s[contact][0] if contact.any() else data.time_s[0])
    settled = elapsed >= min(estimate.SETTLING_S, 0.5 * elapsed[-1])
    error = (data.force_n - data.force_predicted_n)[settled]
    rows = [
        ["samples", str(len(data.time_s))],
        ["length", f"{data.time_s[-1] - data.time_s[0]:.2f} s"],
        [
            "force error one step ahead after the first second of contact, RMS",
            f"{1e3 * np.sqrt(np.nanmean(error**2)):.3g} mN",
        ],
        [
            "the same over the second half",
            f"{1e3 * np.sqrt(np.nanmean(error[len(error) // 2 :] ** 2)):.3g} mN",
        ],
        ["mean NIS (ideal 2)", f"{np.nanmean(data.nis):.2f}"],
        ["changes of the tissue", str(int(np.count_nonzero(data.change_detected)))],
        ["contact law did not fit", f"{100 * np.mean(data.model_mismatch):.0f} % of the samples"],
    ]
    return _table(["figure", "value"], rows)


def _channel_table(data: Any) -> str:
    """Say what stands between the channels: it looks like damping and like other exponents."""
    from hc_evaluation.channels import diagnose_channels, evenly_spaced

    title = "<h2>Between force and displacement</h2>\n"
    try:
        found = diagnose_channels(*evenly_spaced(data.time_s, data.displacement_mm, data.force_n))
    except ValueError as error:
        return f"{title}<p>Not compared: {html.escape(str(error))}.</p>\n"
    clear = found.clear_faults
    late = "displacement lags force by" if found.delay_s < 0.0 else "force lags displacement by"
    rows = [
        [what, f"{value:.3g}", f"{deviation:.2g}", unit, "yes" if name in clear else "no"]
        for name, what, value, deviation, unit in (
            ("delay", late, 1e3 * abs(found.delay_s), 1e3 * found.delay_std_s, "ms"),
            ("zero", "force zero", 1e3 * found.zero_n, 1e3 * found.zero_std_n, "mN"),
            ("contact", "contact position", found.contact_mm, found.contact_std_mm, "mm"),
        )
    ]
    head = ["one fit to the whole recording", "value", "± 1 sd", "unit", "stands out (3 sd)"]
    stiffness, damping, exponent, power = found.parameters
    text = (
        f"With the three taken out: K = {stiffness:.4g}, B = {damping:.4g}, n = {exponent:.4g}, "
        f"p = {power:.4g}; force residual {1e3 * found.residual_rms_n:.3g} mN, left in "
        f"{1e3 * found.residual_rms_without_n:.3g} mN. For one tissue in contact throughout."
    )
    return f"{title}{_table(head, rows)}<p>{text}</p>\n"


def _table(head: list[str], rows: list[list[str]]) -> str:
    def line(cells: list[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    return "<table>" + line(head, "th") + "".join(line(row, "td") for row in rows) + "</table>\n"


def _list(lines: list[str]) -> str:
    if not lines:
        return ""
    return "<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in lines) + "</ul>\n"
