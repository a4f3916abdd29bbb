"""The contact law over arrays is that of the estimators, and its derivatives are its slopes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.contact import adhesive_force as one_adhesive
from hc_estimator.contact import arrays as law
from hc_estimator.contact import hunt_crossley_force as one

SAMPLES = st.tuples(st.floats(-2.0, 8.0), st.floats(-60.0, 60.0))
TISSUES = st.tuples(
    st.floats(0.01, 10.0), st.floats(1e-4, 5.0), st.floats(0.8, 3.0), st.floats(0.4, 2.0)
)


@given(st.lists(st.tuples(SAMPLES, TISSUES), min_size=1, max_size=30))
def test_equals_the_law_of_the_estimators_sample_by_sample(rows):
    d, v = np.array([sample for sample, _ in rows]).T
    tissues = np.array([tissue for _, tissue in rows])
    expected = [one(*sample, *tissue) for sample, tissue in rows]
    # Denormal depths are no depths to one of the two: 1e-308 mm to the power 0.8 is 1e-246 N.
    np.testing.assert_allclose(
        law.hunt_crossley_force(d, v, tissues), expected, rtol=1e-11, atol=1e-200
    )
    expected = [one_adhesive(*sample, *tissue) for sample, tissue in rows]
    np.testing.assert_allclose(
        law.adhesive_force(d, v, tissues),
        expected,
        rtol=1e-9,
        atol=1e-9 * np.max(np.abs(expected)) + 1e-200,
    )
    apart = law.separated(d, v, tissues)
    assert np.all(law.hunt_crossley_force(d, v, tissues)[apart] == 0.0)
    assert np.all(d[apart] > 0.0)


def test_derivatives_are_the_slopes_of_the_force_and_zero_where_the_tool_has_left():
    d = np.array([0.5, 2.0, 3.0, 1.5, -1.0, 2.0])
    v = np.array([4.0, -2.0, 9.0, -30.0, 5.0, 0.0])
    tissue = np.array([0.4, 0.05, 1.7, 1.1])
    for adhesive in (False, True):
        found = law.force_gradient(d, v, tissue, adhesive=adhesive)
        for i in range(6):
            sides = []
            for step in (1e-6, -1e-6):
                depth, speed, changed = d.copy(), v.copy(), tissue.copy()
                if i == 0:
                    depth += step
                elif i == 1:
                    speed += step
                elif i < 4:
                    changed[i - 2] *= np.exp(step)
                else:
                    changed[i - 2] += step
                sides.append(law.force_of(depth, speed, changed, adhesive=adhesive))
            slope = (sides[0] - sides[1]) / 2e-6
            moving = (v != 0.0) | (i != 1)  # the slope at rest is 0 by definition here
            np.testing.assert_allclose(found[moving, i], slope[moving], rtol=1e-5, atol=1e-6)
        assert np.all(found[4] == 0.0)
        assert np.all(found[3] == 0.0) != adhesive
