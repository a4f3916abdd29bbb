"""What a report says in words: right where it can be, doubtful where it must be."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hc_bringup.report.contacts import find_contacts
from hc_bringup.report.run_page import run_page
from hc_bringup.report.verdict import Level, verdict
from hc_bringup.tip_path import TipPath
from hc_bringup.zero_effect import effect_in

MakeRun = Callable[..., Any]
EVIL = "<img src=x onerror=document.title='caught'>.csv"


def said(data: Any, channels: Any = None) -> list[str]:
    return [one.text for one in verdict(data, find_contacts(data), channels, None)]


def test_words_for_a_good_run(make_run: MakeRun) -> None:
    data = make_run(seconds=8.0)
    words = said(data)
    force = 0.3 * 2.0**1.5
    number = float(re.search(r"takes ([\d.]+) ", words[0]).group(1))
    assert number == pytest.approx(force, rel=0.02)
    assert "The contact law describes what the sensors say." in words
    assert any(text.startswith("The true K lies within 3") for text in words)


def test_the_stiffness_of_tissue_that_changed_is_that_after_it(make_run: MakeRun) -> None:
    """Regression: of ten minutes, half of them at half the stiffness, "the tissue takes 1.98 N"."""
    data = make_run(seconds=3.0)
    data.estimates["change_detected"][len(data.time_s) // 2] = 1
    assert said(data)[0].startswith("At rest the tissue, after it changed last, takes ")


def test_words_for_several_places_where_the_law_does_not_fit(make_run: MakeRun) -> None:
    """Regression: relaxing tissue was named, and nobody said that the surfaces may differ."""
    steps = np.arange(0.0, 8.0, 0.01)
    places = np.column_stack([6.0 * (steps // 4.0 + steps // 6.0), np.zeros_like(steps)])
    data = make_run(seconds=8.0, tip=TipPath(steps, places))
    data.estimates["model_mismatch"][::3] = 1
    (found,) = [text for text in said(data) if text.startswith("The contact law does not fit")]
    assert "the tool went to 3 places one after another" in found
    assert found.endswith("hc contacts --sites takes each by itself.")
    slid = make_run(seconds=8.0, tip=TipPath(steps, np.column_stack([9.0 * steps, 0.0 * steps])))
    slid.estimates["model_mismatch"][::3] = 1
    assert not any("places one after another" in text for text in said(slid))


def test_words_for_zeros_that_are_taken_for_exact(make_run: MakeRun) -> None:
    data = make_run(seconds=3.0)
    (one,) = [text for text in said(data) if text.startswith("Contact position and force zero")]
    effect = effect_in(data.settings, data.estimates)
    assert effect.by_position == pytest.approx(0.158, rel=0.2)  # 2 mm, n = 1.5
    assert one == effect.sentence
    unsure = make_run(seconds=3.0, settings={"contact_position_std": 0.05})
    assert not any(text.startswith("Contact position and force zero") for text in said(unsure))


def test_what_stands_behind_the_sign_is_two_deviations_throughout(make_run: MakeRun) -> None:
    """Regression: the contact position had one, beside two of everything else on the page."""
    data = make_run(seconds=3.0, settings={"contact_position_std": 0.05})
    data.estimates["contact_position_std"] = 0.05e-3
    (one,) = [text for text in said(data) if text.startswith("Contact begins at")]
    assert one.startswith("Contact begins at 0.00 ± 0.10 mm")


def test_words_for_doubt(make_run: MakeRun) -> None:
    """Few samples leave room for much, but not for calling it honest; nor is a guess good news."""
    data = make_run(seconds=3.0)
    data.estimates["nis"][:] = 2.0
    data.estimates["nis"][::50] = 60.0  # mean 3.2
    data.estimates["stiffness_std"][:] = 0.35 * data.estimates["stiffness"]
    data.estimates["covariance"][:] = 0.0
    data.estimates["covariance"][:, 0] = data.estimates["stiffness_std"] ** 2
    sentences = verdict(data, find_contacts(data), None, None)
    assert sentences[0].text.startswith("At rest the tissue takes")
    assert sentences[0].level is Level.NOTE
    assert not any("honest" in one.text or "true K" in one.text for one in sentences)
    assert any("larger than the filter admits" in one.text for one in sentences)


def test_words_for_what_cannot_be_seen(make_run: MakeRun) -> None:
    data = make_run(seconds=3.0)
    data.estimates["damping_identifiability"][:] = 0.1
    data.estimates["velocity_exponent_std"][:] = 2.0
    words = said(data)
    assert "Damping cannot be seen from this motion." in words
    assert "Exponent p cannot be seen from this motion." in words


def test_a_law_that_was_not_tested_is_not_called_right(make_run: MakeRun) -> None:
    """Regression: said of a force that relaxed to half under a ramp, K 0.007 ± 0.015."""
    data = make_run(seconds=3.0)
    data.estimates["covariance"][:] = 0.0
    data.estimates["covariance"][:, 0] = data.estimates["stiffness"] ** 2
    words = said(data)
    assert words[0] == "The tissue was touched, but its stiffness is not known."
    assert "Nothing contradicts the contact law, but this motion hardly tests it." in words


def test_words_for_a_tool_in_the_air(make_run: MakeRun) -> None:
    data = make_run(seconds=2.0)
    data.estimates["contact"][:] = False
    assert said(data) == ["The tool never touched anything: nothing can be said."]


def test_words_for_a_delay(make_run: MakeRun) -> None:
    from hc_evaluation.channels import diagnose_channels

    data = make_run(seconds=8.0, lifted_mm=-0.3)
    data.force_n[:] = np.interp(data.time_s + 0.03, data.time_s, data.force_n)
    channels = diagnose_channels(data.time_s, data.displacement_mm, data.force_n)
    sentences = verdict(data, [], channels, None)
    told = [one for one in sentences if "ahead of the displacement" in one.text]
    assert told
    assert told[0].level is Level.BAD
    assert float(told[0].text.split()[3]) == pytest.approx(30.0, abs=3.0)


def test_one_law_over_tissue_that_varies_gives_no_figures_of_a_tissue(make_run: MakeRun) -> None:
    """Regression: K = 0.0028, n = 3.57 "with the three taken out" of a scan over a lump."""
    varies = make_run(stiffness=lambda t: 0.3 * (1.0 + 2.0 * np.exp(-((t - 3.0) ** 2))))
    page = run_page(varies, ["hc", "report"])
    assert "no fault of the channels explains that" in page
    assert "three taken out: K" not in page
    assert "three taken out: K" in run_page(make_run(), ["hc", "report"])


def test_words_for_losses(make_run: MakeRun) -> None:
    data = make_run(seconds=3.0)
    data.estimates["rejected"][5:9] = 1
    data.estimates["sequence"][100:] += 7
    words = said(data)
    assert "7 samples are missing." in words
    assert any(text.startswith("4 samples were refused") for text in words)
    one = make_run(seconds=3.0)  # regression: "1 samples were refused"
    one.estimates["rejected"][5] = 1
    one.estimates["sequence"][100:] += 1
    words = said(one)
    assert "1 sample is missing." in words
    assert any(text.startswith("1 sample was refused") for text in words)


def test_sequence_numbers_that_do_not_count_are_no_losses(make_run: MakeRun) -> None:
    """Regression: of sources without a counter the report told millions of missing samples."""
    data = make_run(seconds=3.0)
    data.estimates["sequence"] = np.random.default_rng(1).integers(0, 2**40, len(data.time_s))
    assert not [text for text in said(data) if "missing" in text]
    data.estimates["sequence"] = np.arange(len(data.time_s))
    data.estimates["sequence"][700:] += 2_000_000
    assert not [text for text in said(data) if "missing" in text]


def test_contact_of_which_nothing_could_be_used(make_run: MakeRun) -> None:
    """Regression: an index that is not there, and no report."""
    data = make_run(seconds=3.0)
    data.estimates["contact"] = True
    data.estimates["rejected"] = 3
    words = said(data)
    assert words[0] == "No sample in contact could be used: nothing can be said."
    assert words[0] in run_page(data, ["hc", "report"])


def test_a_truth_that_was_not_recorded_is_no_error(make_run: MakeRun) -> None:
    """Regression: where the rig's truth was lost on its way, K counted as outside."""
    data = make_run(seconds=8.0)
    (before,) = [text for text in said(data) if text.startswith("The true K lies within 3")]
    data.truth[::2] = np.nan
    data.truth[-1] = np.nan
    (after,) = [text for text in said(data) if text.startswith("The true K lies within 3")]
    share = [float(re.search(r"in (\d+) %", text).group(1)) for text in (before, after)]
    assert share[1] == pytest.approx(share[0], abs=2.0)
    assert "nan" not in run_page(data, ["hc", "report"]).split("<script", maxsplit=1)[0]
    data.truth[:] = np.nan
    assert not [text for text in said(data) if text.startswith("The true K")]


def test_words_where_one_fit_to_all_readings_says_another_force(make_run: MakeRun) -> None:
    """Regression: K = 0.108 ± 0.004 stood on top of the page, and 0.2999 of one fit far below."""
    from hc_evaluation.channels import diagnose_channels

    data = make_run(seconds=8.0)
    channels = diagnose_channels(data.time_s, data.displacement_mm, data.force_n)
    assert not any("One fit" in text for text in said(data, channels))
    data = make_run(seconds=8.0)
    data.estimates["stiffness"] *= 0.5
    first, second, *_others = verdict(data, find_contacts(data), channels, None)
    assert first.text.startswith("At rest")
    assert first.level is Level.NOTE
    assert second.level is Level.BAD
    assert second.text.startswith("One fit to the whole recording leaves noise alone and says 0.8")
    data = make_run(seconds=8.0)
    data.estimates["stiffness"] *= 0.5
    data.estimates["covariance"][:, 0] = (0.3 * data.estimates["stiffness"]) ** 2  # it may be so
    assert not any("One fit" in text for text in said(data, channels))


def test_errors_that_are_far_too_small_are_no_honesty(make_run: MakeRun) -> None:
    """Regression: of two channels that stand still the page said "honest: mean NIS 0.00"."""
    data = make_run(seconds=3.0, truth=None)
    assert any(text.startswith("The filter is honest") for text in said(data))
    data.estimates["nis"][:] = 1e-4
    words = said(data)
    assert not any("honest" in text for text in words)
    assert any("mean NIS 0.0001 (ideal 2)" in text for text in words)
