"""Which module may write which field of a filter's memory (hc_estimator): the architecture of data.

The kernels share records (memory.py, multiple_model/records.py), so a field that turns out wrong
could have been written anywhere. Here it cannot: a record has an owner, and whoever else writes
one of its fields stands in GUESTS by name. Read from the sources: assignments to a field, or to an
element of one, by the name that the record has everywhere (RECORDS). An array that is handed to a
function counts where it is handed on; that is not seen here.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from hc_estimator.filters.registry import FIELDS, SCRATCH
from hc_estimator.multiple_model.records import BANK

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "hc_estimator" / "hc_estimator"
WITHOUT_KERNELS = ("stream", "ros", "node.py")

RECORDS = {  # what a variable of that name is, in every kernel
    "bank": "bank",
    "clock": "clock",
    "noise": "noise",
    "channel": "noise",
    "color": "color",
    "resolution": "resolution",
    "steps": "resolution",
    "force_color": "color",
    "motion": "motion",
    "tool": "tool",
    "rows": "row",
    "row": "row",
    "fresh": "row",
    "judge": "judge",
    "change": "change",
    "maneuver": "maneuver",
    "kept": "kept row",
    "asked": "asked",
    "history": "history",
    "search": "search",
    "fit": "fit",
    "moving": "moving",
    "zeros": "zeros",
    "delay": "delay",
    "finder": "delay",
    "kept_point": "kept point",
    "candidate": "kept point",
    "held": "held",
    "gate": "gate",
    "given": "given",
    "onset": "onset",
    "window": "window",
    "air": "air",
    "place": "place",
    "memory": "memory",
}
OWNERS = {
    "bank": (
        "filters/self_tuning_ukf",
        "multiple_model/beginning",
        "multiple_model/sample",
    ),
    "clock": ("screening", "multiple_model/alignment", "multiple_model/sample"),
    "noise": ("adaptation/difference_noise",),
    "color": ("adaptation/noise_color",),
    "resolution": ("adaptation/resolution",),
    "motion": ("adaptation/motion_density", "adaptation/density_correction"),
    "tool": (
        "multiple_model/levels",
        "multiple_model/plausible",
        "multiple_model/sample",
        "multiple_model/tempering",
    ),
    "row": (
        "multiple_model/rows",
        "multiple_model/kalman",
        "multiple_model/landing",
        "multiple_model/unscented",
        "multiple_model/model_error",
        "multiple_model/delay_sensitivity",
    ),
    "judge": ("multiple_model/judge", "multiple_model/choice", "multiple_model/reserve"),
    "change": ("multiple_model/change", "multiple_model/zero_step"),
    "maneuver": ("multiple_model/maneuver", "multiple_model/departure"),
    "kept row": ("multiple_model/maneuver",),
    "asked": ("multiple_model/asked_kinds",),
    "history": ("multiple_model/history", "multiple_model/batch_fit"),
    "search": ("multiple_model/search",),
    "fit": (
        "multiple_model/spline",
        "multiple_model/spline_prior",
        "multiple_model/spline_start",
        "multiple_model/spline_fit",
        "multiple_model/spline_descent",
    ),
    "moving": (
        "multiple_model/moving_fit",
        "multiple_model/moving_kinds",
        "multiple_model/moving_delay",
        "multiple_model/spline_outcome",
    ),
    "zeros": (
        "multiple_model/zero_average",
        "multiple_model/zero_choice",
        "multiple_model/zero_fit",
        "multiple_model/zero_kinds",
        "multiple_model/zero_sensitivity",
    ),
    "delay": (
        "multiple_model/delay",
        "multiple_model/grid",
        "multiple_model/raw_readings",
        "multiple_model/local_polynomial",
        "multiple_model/smoothing",
        "multiple_model/delay_points",
        "multiple_model/delay_candidates",
        "multiple_model/delay_equations",
        "multiple_model/delay_fit",
        "multiple_model/delay_evidence",
    ),
    "kept point": ("multiple_model/delay_points",),
    "held": ("multiple_model/alignment", "multiple_model/held_readings"),
    "gate": (
        "multiple_model/outliers",
        "multiple_model/jumps",
        "multiple_model/position_step",
    ),
    "given": ("multiple_model/report",),
    "onset": (
        "multiple_model/contact_onset",
        "multiple_model/contact_level",
        "multiple_model/contact_rise",
        "multiple_model/zero_moves",
    ),
    "window": ("multiple_model/air_window",),
    "air": ("multiple_model/air_zero",),
    "place": (
        "multiple_model/another_place",
        "multiple_model/place_fit",
        "multiple_model/place_average",
        "multiple_model/place_before",
        "multiple_model/place_prior",
        "multiple_model/place_delay",
        "multiple_model/place_change",
    ),
    # The flat memory of the plain filters: who predicts, corrects, and begins anew.
    "memory": ("prediction", "correction", "recovery"),
}
GUESTS = {
    "multiple_model/alignment": {
        "bank": "motion_anew",
        "change": "detected",
        "delay": "delay deviation doubt",
        "judge": "chosen",
        "given": "latest_force",
        "row": "active",
    },
    "multiple_model/another_place": {"history": "contact"},
    # A delay that the contacts show is the one in use.
    "multiple_model/place_delay": {"delay": "delay deviation doubt fit"},
    "multiple_model/moving_fit": {"judge": "found"},
    # What goes on is given up, or goes on with what has moved.
    "multiple_model/search": {
        "fit": "air_zero phase values",
        "moving": "stage",
        "zeros": "air_zero stage",
    },
    # Likewise one that is found beneath a surface that moves.
    "multiple_model/moving_delay": {
        "delay": "delay deviation doubt fit",
        "fit": "delay_deviation shift spacing values",
    },
    "multiple_model/delay_equations": {"kept point": "weight"},
    "multiple_model/zero_rival": {"fit": "fixed"},
    "multiple_model/air_zero": {"onset": "force_deviation in_air shift"},
    "multiple_model/beginning": {
        "change": "detected",
        "clock": "refused_count refused_since started",
        "history": "fit unfitted",
        "row": "active index state",
        "tool": "away_time contact_clock worthless_time",
    },
    # What the tool's motion makes of the force is for the contact law to say.
    "multiple_model/readings": {
        "bank": "calibrated motion_anew sensor_noise",
        "color": "moved",
    },
    "multiple_model/outliers": {"bank": "motion_anew", "clock": "outlier_counts"},
    "multiple_model/sample": {
        "change": "detected fitting_time",
        "given": "extrapolated",
        "maneuver": "count",
        "row": "active",
    },
    "filters/self_tuning_ukf": {"change": "detected"},
    "multiple_model/contact_onset": {"row": "position_deviation"},
    # Everything that was remembered with the old zeros is moved here.
    "multiple_model/zero_step": {
        "row": "active covariance innovation innovation_variance nis state",
    },
    "multiple_model/zero_moves": {
        "clock": "measurement",
        "air": "sum",
        "delay": "raw_value",
        "gate": "zero_before",
        "given": "predicted_force reconstructed_force",
        "held": "value",
        "maneuver": "count",
        "motion": "first states",
        "noise": "readings",
        "row": "covariance position_deviation state",
    },
    "multiple_model/moving_rows": {
        "judge": "chosen found found_at",
        "moving": "moved_at",
        "row": "active counts_from covariance log_likelihood model_error position_deviation score "
        "since state",
    },
    "multiple_model/zero_kinds": {"fit": "air_zero air_zero_deviation held"},
    "multiple_model/zero_fit": {
        "fit": "held values",
        "onset": "force_deviation position_deviation shift",
    },
    "multiple_model/batch_fit": {
        "row": "active covariance log_likelihood model_error score state",
    },
    "multiple_model/change": {
        "row": "active alarmed change_lead contact_time model_error score",
    },
    "multiple_model/choice": {"row": "log_likelihood score"},
    "multiple_model/levels": {"row": "by_delay"},
    "multiple_model/judge": {
        "row": "claimed counts_from inconsistent_time log_likelihood model_error score",
    },
    "multiple_model/maneuver": {
        "row": "alarm_sum covariance state",
    },
    "multiple_model/plausible": {"row": "predicted_force state"},
    "multiple_model/reserve": {"row": "active state"},
    "multiple_model/fit_covariance": {"history": "covariance damped"},
    "multiple_model/point_velocity": {
        "history": "cubic_share trembles velocity_noise velocity_std"
    },
    "adaptation/change_detection": {
        "memory": "change_filled change_position change_quiet change_sum change_values"
    },
    "adaptation/covariance_matching": {
        "memory": "matching_count matching_filled matching_mean matching_position next_noise "
        "next_process_noise_scale noise process_noise process_noise_scale"
    },
    "adaptation/noise_doubt": {
        "memory": "doubt_differences doubt_following doubt_force doubt_noise doubt_patience "
        "doubt_quiet doubt_readings doubt_time doubt_windows"
    },
    "adaptation/policy": {"memory": "change_detected covariance measurement_noise noise state"},
    "adaptation/strong_tracking": {
        "memory": "first_square point tracking_filled tracking_position tracking_values"
    },
    "adaptation/tempering": {"memory": "tempering_count"},
    "adaptation/variational_bayes": {"memory": "bayes_scale bayes_shape noise"},
    "filters/adaptive_ukf": {"memory": "change_detected measurement_noise"},
    "filters/particle_models": {"memory": "point"},
    "filters/rbpf": {"memory": "begun change_detected"},
    "filters/rls": {
        "memory": "begun change_detected curvature predicted_measurement prior_variance regression "
        "regression_factor regression_prior regression_seen regressor sensitivity state"
    },
    "filters/rwstukf": {"memory": "innovation nis predicted_measurement"},
    "filters/sir_pf": {"memory": "begun change_detected predicted_covariance restart"},
    "random_numbers": {"memory": "random_counter"},
}


def chain(node: ast.expr) -> list[str]:
    """`bank.rows[i].state[k]` as its names; nothing if it does not begin with a variable."""
    names: list[str] = []
    while not isinstance(node, ast.Name):
        if isinstance(node, ast.Attribute):
            names.append(node.attr)
            node = node.value
        elif isinstance(node, ast.Subscript):
            node = node.value
        else:
            return []
    return [node.id, *reversed(names)]


def written(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Record and field of every assignment to a field of one."""
    for node in ast.walk(tree):
        targets: list[ast.expr] = []
        if isinstance(node, ast.Assign):
            targets = node.targets
        elif isinstance(node, (ast.AugAssign, ast.AnnAssign, ast.For)):
            targets = [node.target]
        while targets:
            target = targets.pop()
            if isinstance(target, (ast.Tuple, ast.List)):
                targets += target.elts
                continue
            names = chain(target)
            if len(names) > 1 and names[-2] in RECORDS:
                yield RECORDS[names[-2]], names[-1]


def writes() -> Iterator[tuple[str, str, str]]:
    """Module, record and field of every such assignment in the kernels."""
    for path in sorted(PACKAGE.rglob("*.py")):
        module = path.relative_to(PACKAGE)
        if module.parts[0] not in WITHOUT_KERNELS:
            for record, field in written(ast.parse(path.read_text(encoding="utf-8"))):
                yield module.with_suffix("").as_posix(), record, field


def test_only_its_owner_or_a_named_guest_writes_a_field() -> None:
    strangers = {
        f"{module} writes {record}.{field}"
        for module, record, field in writes()
        if module not in OWNERS[record]
        and field not in GUESTS.get(module, {}).get(record, "").split()
    }
    assert not strangers, "let the record's owner do it, or name the guest in GUESTS"


def test_the_table_names_nobody_who_does_not_write() -> None:
    done = set(writes())
    idle = {
        f"{module} does not write {record}.{field}"
        for module, records in GUESTS.items()
        for record, fields in records.items()
        for field in fields.split()
        if (module, record, field) not in done
    }
    idle |= {
        f"{module} does not write any of {record}"
        for record, modules in OWNERS.items()
        for module in modules
        if not any((module, record) == (m, r) for m, r, _ in done)
    }
    assert not idle


def test_every_record_of_the_bank_is_in_the_table() -> None:
    nested = {field.name for field in BANK if not isinstance(field.kind, type)}
    assert nested
    assert nested <= RECORDS.keys()


def test_the_flat_memory_has_the_fields_that_the_table_names() -> None:
    names = {field.name for field in FIELDS + SCRATCH}
    assert {field for _, record, field in writes() if record == "memory"} <= names


def test_a_stranger_is_seen() -> None:
    text = (
        "def f(bank, x):\n    bank.rows[2].state[0] += 1.0\n    (bank.judge.chosen, x) = 1, 2\n"
        "    x.y = 3\n    for bank.felt in x:\n        pass\n"
    )
    assert set(written(ast.parse(text))) == {
        ("row", "state"),
        ("judge", "chosen"),
        ("bank", "felt"),
    }
