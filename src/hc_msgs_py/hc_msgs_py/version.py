"""The version of the suite: here, and from here in pyproject.toml and in what the nodes tell.

package.xml of each package and hc_estimator (whose compiled kernels would be compiled anew by an
import from here) repeat it; test/suite/test_version.py finds one that was forgotten.
"""

VERSION = "0.1.0"
