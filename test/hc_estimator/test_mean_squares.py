"""What noise alone makes of a mean square, against the quantiles of chi-square."""

import pytest
from scipy.stats import chi2, norm

from hc_estimator.mean_squares import largest_by_noise


@pytest.mark.parametrize("deviations", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("freedom", [5.0, 14.0, 28.0, 74.0])
def test_it_is_the_quantile_of_chi_square(freedom, deviations):
    expected = chi2.ppf(norm.cdf(deviations), freedom) / freedom
    assert largest_by_noise(freedom, deviations) == pytest.approx(expected, rel=0.04)
    assert largest_by_noise(0.0, deviations) == largest_by_noise(1.0, deviations)
