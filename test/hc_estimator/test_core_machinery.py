"""Random numbers, resampling, the compilation cache and the specifications."""

import math
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import hc_estimator as hc
from hc_estimator import documentation, random_numbers, resampling, vector_mathematics
from hc_estimator import estimator as estimator_module
from hc_estimator.adaptation import strong_tracking
from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import CONTACT_MODELS
from hc_estimator.estimator import MEMORY, SETTINGS
from hc_estimator.kinds import parameter_specifications


@compiled
def draw(settings_array, memory_array, kind, shape, out):
    settings, memory = settings_array[0], memory_array[0]
    for k in range(out.size):
        if kind == 0:
            out[k] = random_numbers.uniform(settings, memory)
        elif kind == 1:
            out[k] = random_numbers.normal(settings, memory)
        elif kind == 2:
            out[k] = random_numbers.exponential(settings, memory)
        else:
            out[k] = random_numbers.gamma(settings, memory, shape)


def numbers(kind, count=20000, seed=1, shape=1.0):
    settings, memory, out = np.zeros(1, SETTINGS), np.zeros(1, MEMORY), np.empty(count)
    settings["seed"] = seed
    draw(settings, memory, kind, shape, out)
    return out


@pytest.mark.parametrize(
    ("kind", "shape", "distribution"),
    [
        (0, 1.0, stats.uniform()),
        (1, 1.0, stats.norm()),
        (2, 1.0, stats.expon()),
        (3, 0.05, stats.gamma(0.05)),
        (3, 3.0, stats.gamma(3.0)),
    ],
)
def test_random_numbers_have_their_distribution(kind, shape, distribution):
    sample = numbers(kind, shape=shape)
    assert stats.kstest(sample, distribution.cdf).pvalue > 1e-3
    assert abs(np.corrcoef(sample[1:], sample[:-1])[0, 1]) < 0.03
    np.testing.assert_array_equal(sample, numbers(kind, shape=shape))
    assert not np.array_equal(sample, numbers(kind, shape=shape, seed=2))


def test_uniform_numbers_are_never_0_or_1():
    sample = numbers(0, 200_000)
    assert sample.min() > 0
    assert sample.max() < 1


def test_many_normal_numbers_are_the_pairs_of_the_uniform_ones():
    """Box and Muller's pair from `uniform`, to rounding; an odd one at the end takes two."""
    for count in (1, 2, 9, 1000):
        settings, memory = np.zeros(1, SETTINGS), np.zeros(1, MEMORY)
        settings["seed"], memory["random_counter"] = 7, 12
        target = np.empty(count)
        random_numbers.fill_normal(settings[0], memory[0], target)
        pairs = -(-count // 2)
        assert memory["random_counter"] == 12 + 2 * pairs
        memory["random_counter"] = 12
        uniform = [random_numbers.uniform(settings[0], memory[0]) for _ in range(2 * pairs)]
        radius, angle = np.sqrt(-2 * np.log(uniform[::2])), 2 * np.pi * np.array(uniform[1::2])
        expected = np.concatenate([radius * np.cos(angle), radius * np.sin(angle)])
        np.testing.assert_allclose(target, expected[:count], rtol=0, atol=1e-14)
        assert count < 1000 or stats.kstest(target, stats.norm().cdf).pvalue > 0.01


def each(function, values, part=None):
    """A function of numbers in a loop over a vector, as a kernel has it; one part of a tuple."""

    @numba.njit
    def loop(x, target):
        for k in range(x.shape[0]):
            target[k] = function(x[k])

    @numba.njit
    def loop_of_part(x, target):
        for k in range(x.shape[0]):
            target[k] = function(x[k])[part]

    target = np.empty(len(values))
    (loop if part is None else loop_of_part)(values, target)
    return target


def test_mathematics_without_branches_are_the_c_librarys():
    rng = np.random.default_rng(3)
    x = np.concatenate([rng.uniform(-707, 708, 50_000), rng.uniform(-1, 1, 50_000), [0.0, 709.0]])
    np.testing.assert_array_max_ulp(each(vector_mathematics.exponential, x), np.exp(x), 1)
    wide = np.exp(x[:-1])
    np.testing.assert_array_max_ulp(each(vector_mathematics.logarithm, wide), np.log(wide), 1)
    turn = np.concatenate([rng.uniform(0, 1, 50_000), np.arange(9) / 8])
    for sine_or_cosine, function in enumerate((np.sin, np.cos)):
        found = each(vector_mathematics.sine_and_cosine, turn, sine_or_cosine)
        np.testing.assert_allclose(found, function(2 * np.pi * turn), rtol=0, atol=1e-15)
    edges = each(vector_mathematics.exponential, np.array([-np.inf, -709.0, np.inf, np.nan]))
    np.testing.assert_array_equal(edges, [0.0, 0.0, np.exp(709.0), np.nan])


@given(st.lists(st.floats(-1e100, 1e100), min_size=1, max_size=40))
def test_sums_and_extremes_of_vectors(values):
    x = np.array(values)
    bound = 1e-14 * np.abs(x).sum()
    assert abs(vector_mathematics.total(x) - math.fsum(x)) <= bound
    product = vector_mathematics.total_product(x, x[::-1].copy())
    assert abs(product - math.fsum(x * x[::-1])) <= 1e-14 * np.abs(x * x[::-1]).sum()
    assert vector_mathematics.largest(x) == x.max()
    assert vector_mathematics.smallest(x) == x.min()
    with_hole = np.append(x, np.nan)
    assert vector_mathematics.largest(with_hole) == x.max()
    assert vector_mathematics.smallest(with_hole) == x.min()


def flattened(log_likelihoods, share, before=None):
    """Power, logarithms of the weights and weights after a sample with these log likelihoods."""
    count = len(log_likelihoods)
    before = np.full(count, -math.log(count)) if before is None else np.array(before, float)
    logarithms, weights = before + log_likelihoods, np.empty(count)
    power = resampling.flatten(before, logarithms, weights, share)
    return power, logarithms, weights


def test_weights_far_below_the_smallest_double_are_normalised():
    power, logarithms, weights = flattened([-1e5, -1e5 - math.log(3), -math.inf, math.nan], 0.0)
    assert power == 1.0
    np.testing.assert_allclose(weights, [0.75, 0.25, 0, 0], rtol=1e-10)
    np.testing.assert_allclose(np.exp(logarithms), weights, rtol=1e-10)
    assert math.isnan(flattened([-math.inf, -math.inf], 0.5)[0])


def test_particles_without_a_weight_get_none_from_a_likelihood():
    before = [*np.log([0.5, 0.5]), -math.inf, math.log(0.25)]
    _, logarithms, weights = flattened([-3.0, -1.0, 50.0, math.nan], 0.9, before)
    assert (weights[2:] == 0.0).all()
    assert (logarithms[2:] == -math.inf).all()
    assert weights.sum() == pytest.approx(1)
    assert weights[1] > weights[0]


def test_systematic_resampling_draws_each_particle_in_proportion():
    """Each particle is drawn floor or ceil of count times weight, on average exactly that."""
    weights = np.array([0.05, 0.3, 0.001, 0.449, 0.2])
    settings, memory = np.zeros(1, SETTINGS), np.zeros(1, MEMORY)
    counts = np.zeros(5)
    runs = 400
    for _ in range(runs):
        places = np.empty(5)
        resampling.draw_places(settings[0], memory[0], weights, places)
        drawn = np.bincount(places.astype(int), minlength=5)
        assert np.all(np.abs(drawn - 5 * weights) < 1)
        assert (np.diff(places) >= 0).all()
        counts += drawn
    np.testing.assert_allclose(counts / runs, 5 * weights, atol=0.1)


def test_effective_sample_size():
    assert resampling.effective_sample_size(np.full(4, 0.25)) == pytest.approx(4)
    assert resampling.effective_sample_size(np.array([1.0, 0.0])) == pytest.approx(1)


@given(st.lists(st.floats(-1e8, 0.0), min_size=2, max_size=30), st.floats(0.05, 0.95))
@settings(max_examples=100)
def test_flattening_keeps_the_share_that_it_promises(log_likelihoods, share):
    count = len(log_likelihoods)
    power, logarithms, weights = flattened(np.array(log_likelihoods), share)
    assert 0 <= power <= 1
    assert weights.sum() == pytest.approx(1)
    np.testing.assert_allclose(np.exp(logarithms), weights, rtol=1e-6, atol=1e-140)
    assert resampling.effective_sample_size(weights) >= share * count * 0.999
    order = np.argsort(log_likelihoods)
    assert (np.diff(weights[order]) >= -1e-12).all()


@pytest.mark.parametrize("spread", [0.5, 10.0, 1e3, 1e6])
@pytest.mark.parametrize("share", [0.3, 0.95])
def test_flattening_gives_up_no_more_than_is_asked(spread, share):
    """Where likelihoods must be flattened, the sample size ends next to what may be lost."""
    rng = np.random.default_rng(5)
    log_likelihoods = -0.5 * (spread * rng.standard_normal(500)) ** 2
    power, _, weights = flattened(log_likelihoods, share)
    kept = resampling.effective_sample_size(weights) / 500
    assert kept >= share
    assert power == 1.0 or math.log(kept) < 0.98 * math.log(share)


def python(code, **environment):
    result = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


@pytest.mark.process
def test_import_compiles_nothing_and_needs_no_ros():
    code = """
        import sys
        import hc_estimator as hc
        from hc_estimator.filters.registry import FILTERS
        print(sum(len(f.run.signatures) for f in FILTERS.values()), "rclpy" in sys.modules)
    """
    assert python(code) == ["0", "False"]


PACKAGE = {
    "__init__.py": "",
    "compilation.py": Path(hc.__file__).with_name("compilation.py").read_text(),
    "inner.py": """
from {name}.compilation import compiled

@compiled
def inner(x):
    return x + 1.0
""",
    "outer.py": """
from {name}.compilation import compiled
from {name}.inner import inner

@compiled
def outer(x):
    return 2.0 * inner(x)
""",
}


@pytest.mark.slow
@pytest.mark.process
def test_cache_serves_the_next_process_and_never_goes_stale(tmp_path):
    """Numba alone would go on serving `outer` with the old `inner` inside."""
    folder = tmp_path / "made_up"
    folder.mkdir()
    for name, text in PACKAGE.items():
        (folder / name).write_text(text.replace("{name}", "made_up"))
    code = """
        from made_up.outer import outer
        print(outer(1.0), sum(outer.stats.cache_hits.values()))
    """
    where = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert python(code, **where) == ["4.0", "0"]
    assert python(code, **where) == ["4.0", "1"]
    inner = folder / "inner.py"
    inner.write_text(inner.read_text().replace("x + 1.0", "x + 10.0"))
    assert python(code, **where) == ["22.0", "0"]


@pytest.mark.slow
def test_a_user_who_cannot_write_the_checkout_uses_what_was_compiled_there(tmp_path):
    """Everything was compiled anew once for such a user, for minutes."""
    folder = tmp_path / "made_up"
    folder.mkdir()
    for name, text in PACKAGE.items():
        (folder / name).write_text(text.replace("{name}", "made_up"))
    code = """
        from made_up.outer import outer
        print(outer(1.0), sum(outer.stats.cache_hits.values()))
    """
    read_only = """
        from numba.core.caching import InTreeCacheLocator, UserWideCacheLocator
        def refuse(self):
            raise OSError(30, "Read-only file system")
        InTreeCacheLocator.ensure_cache_path = refuse
    """
    homeless = read_only + "    UserWideCacheLocator.ensure_cache_path = refuse\n    "
    other = code.replace("1.0", "3")  # other types: not among what is shipped
    where = {"PYTHONPATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "home")}
    assert python(code, **where) == ["4.0", "0"]  # by who installs
    shipped = sorted((folder / "__pycache__").glob("*.nb?"))
    assert len(shipped) == 4
    assert python(read_only + code, **where) == ["4.0", "1"]
    assert python(homeless + code, **where) == ["4.0", "1"]
    assert python(homeless + other, **where) == ["8.0", "0"]
    assert python(read_only + other, **where) == ["8.0", "0"]
    assert python(read_only + other, **where) == ["8.0", "1"]  # kept in the user's own cache
    assert sorted((folder / "__pycache__").glob("*.nb?")) == shipped


def test_warm_up_leaves_no_trace():
    estimator = hc.create_estimator("rwstukf")
    before = estimator.state()
    estimator.warm_up()
    assert estimator.state() == before
    assert len(estimator._run.signatures) == 1
    assert len(estimator_module._set_noise.signatures) == 1  # a reconfiguration must not stall


def test_state_spaces_and_contact_models_of_a_filter():
    assert hc.available_state_spaces("rls") == ("kinematic",)
    assert hc.available_contact_models("rls") == ("hunt_crossley",)
    assert set(hc.available_state_spaces("ukf")) == set(hc.available_state_spaces())
    with pytest.raises(ValueError, match="state_space = 'paper' does not go with filter 'rls'"):
        hc.create_estimator("rls", state_space="paper")
    with pytest.raises(ValueError, match="contact_model = 'kelvin_voigt' does not go with"):
        hc.create_estimator("rls", contact_model="kelvin_voigt")
    with pytest.raises(ValueError, match="filter = 'kf' is not one of"):
        hc.available_state_spaces("kf")
    for name in hc.available_filters():
        assert hc.filter_summary(name)


def test_numbers_of_other_types_are_taken():
    estimator = hc.create_estimator("ukf", force_limit=np.float32(50), outlier_limit=4.0)
    assert estimator.configuration["force_limit"] == 50.0
    assert estimator.configuration["outlier_limit"] == 4
    assert isinstance(estimator.configuration["outlier_limit"], int)
    with pytest.raises(ValueError, match=r"outlier_limit = 4\.5 is not an integer"):
        hc.create_estimator("ukf", outlier_limit=4.5)
    with pytest.raises(ValueError, match="noise_adaptation = 'often' is not one of fixed"):
        hc.create_estimator("ukf", noise_adaptation="often")
    with pytest.raises(ValueError, match="limit_parameters = 1 is not true or false"):
        hc.create_estimator("ukf", state_space="paper", limit_parameters=1)


def test_the_documentation_says_which_settings_the_node_does_not_have():
    """Regression: `find_places` stood there as any other, and the node has no such parameter."""
    rows = [line for line in documentation.parameter_tables().splitlines() if line[:3] == "| `"]
    known = {s.name for s in parameter_specifications("self_tuning_ukf", "kinematic")}
    (places,) = [row for row in rows if "`find_places`" in row]
    assert "find_places" not in known
    assert places.endswith("No parameter of the node. |")
    (zeros,) = [row for row in rows if "`find_zeros`" in row]
    assert "find_zeros" in known
    assert "No parameter of the node" not in zeros


def test_parameter_tables_of_the_documentation_are_up_to_date():
    """If this fails: python -m hc_estimator.documentation docs/estimators.md."""
    page = Path(__file__).parents[2] / "docs" / "estimators.md"
    assert documentation.with_tables(page.read_text()) == page.read_text()
    for name in hc.available_filters():
        assert f"`{name}`" in page.read_text()
    with pytest.raises(ValueError, match="the page needs the lines"):
        documentation.with_tables("a page without marks")


@compiled
def scale(settings_array, memory_array, factor):
    strong_tracking.scale_covariance(settings_array[0], memory_array[0], factor)


@pytest.mark.parametrize(("model", "scaled"), [("hunt_crossley", 1.0), ("kelvin_boltzmann", 4.0)])
def test_strong_tracking_scales_a_velocity_that_lags_as_the_motion(model, scaled):
    """It stands where p does, and was held back by the prior of a p that its law does not have."""
    settings, memory = np.zeros(1, SETTINGS), np.zeros(1, MEMORY)
    settings["contact_model"] = CONTACT_MODELS.index(model)
    memory["predicted_covariance"][0] = np.eye(7)
    memory["prior_variance"][0] = [2.0, 8.0, 1.0, 0.0]
    scale(settings, memory, 4.0)
    found = np.diag(memory["predicted_covariance"][0])
    np.testing.assert_allclose(found, [4.0, 4.0, 4.0, 2.0, 4.0, 1.0, scaled])
