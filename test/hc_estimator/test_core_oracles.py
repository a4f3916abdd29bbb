"""The adaptive filters against plain textbook implementations that share no code with them.

Everything below is written from the papers' equations with numpy's matrices, the covariance update
in its short form, `numpy.linalg` for roots and inverses, one sample at a time.
"""

import numpy as np
import pytest

import hc_estimator as hc

EXPONENT_LIMITS = (0.5, 4.0), (0.25, 3.0)


def law(d, v, K, B, n, p, adhesive):
    if d <= 0:
        return 0.0
    n, p = np.clip(n, *EXPONENT_LIMITS[0]), np.clip(p, *EXPONENT_LIMITS[1])
    force = K * d**n + B * d**n * np.sign(v) * abs(v) ** p
    return force if adhesive else max(0.0, force)


class Kinematic:
    """[d, v, a, ln K, ln B, n, p]."""

    def __init__(self, c, adhesive):
        self.c, self.adhesive = c, adhesive

    def start(self, d, force):
        c = self.c
        logs = np.log([c["initial_stiffness"], c["initial_damping"]])
        x = np.array([d, 0, 0, *logs, *self.exponents()])
        motion = ["displacement", "velocity", "acceleration"]
        rest = ["stiffness_log", "damping_log", "displacement_exponent", "velocity_exponent"]
        return x, np.diag([c[f"initial_{name}_std"] for name in motion + rest]) ** 2

    def exponents(self):
        return self.c["initial_displacement_exponent"], self.c["initial_velocity_exponent"]

    def f(self, x, dt):
        d, v, a = x[:3]
        return np.array([d + v * dt + a * dt**2 / 2, v + a * dt, a, *x[3:]])

    def h(self, x):
        force = law(x[0], x[1], *np.exp(x[3:5]), x[5], x[6], self.adhesive)
        return np.array([x[0], force])

    def process_noise(self, dt):
        c = self.c
        g = np.array([dt**3 / 6, dt**2 / 2, dt])
        white = np.outer(g, g) / dt  # of a jerk constant over the step, corrected below
        white[0, 0] = dt**5 / 20
        white[0, 1] = white[1, 0] = dt**4 / 8
        white[0, 2] = white[2, 0] = dt**3 / 6
        white[1, 1] = dt**3 / 3
        Q = np.zeros((7, 7))
        Q[:3, :3] = c["jerk_density"] * white
        names = ["stiffness_log", "damping_log", "displacement_exponent", "velocity_exponent"]
        Q[3:, 3:] = np.diag([c[f"{name}_walk"] * dt for name in names])
        return Q

    def scaled(self, Q, scale):
        Q = Q.copy()
        Q[:3, :3] *= scale
        return Q

    def parameters(self, x):
        return np.array([*np.exp(x[3:5]), *x[5:]])

    def constrained(self, x):
        x = x.copy()
        x[5], x[6] = np.clip(x[5], *EXPONENT_LIMITS[0]), np.clip(x[6], *EXPONENT_LIMITS[1])
        return x


class Paper:
    """[d, v, F, K, B, n, p] (paper B, Eq. 2 and 3)."""

    def __init__(self, c, adhesive):
        self.c, self.adhesive = c, adhesive

    def start(self, d, force):
        c = self.c
        names = ["stiffness", "damping", "displacement_exponent", "velocity_exponent"]
        x = np.array([d, 0, force, *(c[f"initial_{name}"] for name in names)])
        names = ["displacement", "velocity", "force", *names]
        return x, np.diag([c[f"initial_{name}_std"] for name in names]) ** 2

    def f(self, x, dt):
        force = law(x[0], x[1], *x[3:], self.adhesive)
        return np.array([x[0] + x[1] * dt, x[1], force, *x[3:]])

    def h(self, x):
        return np.array([x[0], x[2]])

    def process_noise(self, dt):
        c = self.c
        names = [f"process_noise_{n}" for n in ["displacement", "velocity", "force"]]
        names += ["process_noise_stiffness", "process_noise_damping"]
        names += ["displacement_exponent_walk", "velocity_exponent_walk"]
        return np.diag([c[name] * dt for name in names])

    def scaled(self, Q, scale):
        Q = Q.copy()
        Q[2, 2] *= scale
        return Q

    def parameters(self, x):
        return x[3:]

    def constrained(self, x):
        x = x.copy()
        x[3:5] = np.maximum(x[3:5], 0)
        x[5], x[6] = np.clip(x[5], *EXPONENT_LIMITS[0]), np.clip(x[6], *EXPONENT_LIMITS[1])
        return x


def sigma_points(x, P, c):
    """Points and weights of the scaled unscented transform (paper A, Eq. 7 and 9)."""
    N = x.size
    lam = c["alpha"] ** 2 * (N + c["kappa"]) - N
    root = np.linalg.cholesky((N + lam) * P)
    points = np.vstack([x, *(x + root.T), *(x - root.T)])
    wm = np.full(2 * N + 1, 0.5 / (N + lam))
    wc = wm.copy()
    wm[0] = lam / (N + lam)
    wc[0] = wm[0] + 1 - c["alpha"] ** 2 + c["beta"]
    return points, wm, wc


def transform(function, points, wm, wc):
    images = np.array([function(point) for point in points])
    mean = wm @ images
    deviation = images - mean
    return mean, deviation.T @ (wc[:, None] * deviation), deviation


class Oracle:
    """An unscented filter that repeats the update (paper A) or adapts Q and R (paper B)."""

    def __init__(self, space, c, kind):
        self.space, self.c, self.kind = space, c, kind
        self.R = np.diag([c["displacement_noise_std"] ** 2, c["force_noise_std"] ** 2])
        self.first_R = self.R.copy()
        self.scale = 1.0
        self.window = []  # per sample: K Z (7), diagonal of P(k|k), Z
        self.recursive = None
        self.J = 0
        self.time = None

    def matched(self):
        """What the last window says the predicted covariances should be (Eq. 22, 33, 29, 34)."""
        c, m = self.c, self.c["matching_window"]
        last = self.window[-m:]
        moves = np.array([np.outer(w[0], w[0]) for w in last]).mean(0)
        if c["matching_trace"] == "corrected":
            moves = moves + np.mean([w[1] for w in last], axis=0)
            p = moves[2, 2]
        else:
            p = np.trace(moves)
        y = np.array([w[2] ** 2 for w in last]).mean(0)
        return np.array([p, *y])

    def step(self, time, d, force):
        c, space = self.c, self.space
        y = np.array([d, force])
        corrected = c.get("matching_trace") == "corrected"
        if self.time is None:
            x, P = space.start(d, force)
            Q = np.zeros((7, 7))
        else:
            dt = time - self.time
            points, wm, wc = sigma_points(self.x, self.P, c)
            x, P, _ = transform(lambda q: space.f(q, dt), points, wm, wc)
            Q = space.process_noise(dt)
            if self.recursive is not None and c.get("adapted_noise") in ("process", "both"):
                if corrected:
                    found = (self.recursive[0] - P[2, 2]) / Q[2, 2]
                else:
                    found = (self.recursive[0] - np.trace(P)) / np.trace(Q)
                if found > 0:
                    self.scale = max(found, c["matching_floor"])
            Q = space.scaled(Q, self.scale) if corrected else Q * self.scale
        P = P + Q
        gamma = 1.0
        first = None
        for _ in range(2):
            points, wm, wc = sigma_points(x, P, c)
            predicted, S, deviation = transform(space.h, points, wm, wc)
            if (
                first is None
                and self.recursive is not None
                and c.get("adapted_noise") in ("measurement", "both")
            ):
                found = self.recursive[1:] - np.diag(S)
                if not corrected:
                    found = found.sum() / np.trace(self.R) * np.diag(self.R)
                floor = c["matching_floor"] * np.diag(self.first_R)
                diagonal = np.where(found > 0, np.maximum(found, floor), np.diag(self.R))
                self.R = np.diag(diagonal)
            H_P_H = S
            S = S + self.R
            Z = y - predicted
            Pxy = (points - x).T @ (wc[:, None] * deviation)
            nis = Z @ np.linalg.solve(S, Z)
            if first is not None or self.kind != "rwstukf":
                break
            first = Z, predicted, nis
            if nis > c["mahalanobis_threshold"]:
                gamma = self.scaling(Z, H_P_H)
            if gamma == 1.0:
                break
            if c["scaling_form"] == "guarded":  # no parameter above its prior variance
                prior = np.diag(space.start(0.0, 0.0)[1])
                room = np.maximum(prior / np.diag(P), 1.0)
                room[:3] = np.inf
                rise = np.sqrt(np.minimum(gamma, room))
                P = rise[:, None] * P * rise
            else:
                P = gamma * P
        K = Pxy @ np.linalg.inv(S)
        self.x = space.constrained(x + K @ Z)
        self.P = P - K @ S @ K.T
        self.time = time
        if first is not None:
            Z, predicted, nis = first
        self.window.append((K @ Z, self.P.copy(), Z))
        if "matching_window" in c and len(self.window) >= c["matching_window"]:
            now = self.matched()
            self.J += 1
            weight = 1.0 if self.kind == "aukf" else 1.0 / self.J
            before = np.zeros(3) if self.recursive is None else self.recursive
            self.recursive = weight * now + (1 - weight) * before
        return np.concatenate([space.parameters(self.x), [predicted[1]], Z, [nis, gamma]])

    def scaling(self, Z, H_P_H):
        """Eq. 29 in units of the noise, window of one: the random weight is 1 whatever is drawn."""
        unit = np.diag(1 / np.diag(self.R))
        if not self.window:
            return 1.0
        past = self.window[-1][2]
        factor = (past @ unit @ past - 2) / np.trace(unit @ H_P_H)
        if self.c["scaling_form"] == "guarded":
            return min(max(factor, 1.0), self.c["largest_scaling"])
        return abs(factor)


COMMON = {"tempering_amplitude": 0.0, "outlier_gate": 1e9}
NEAR = {  # a first guess from which every form converges
    "initial_stiffness": 0.3,
    "initial_damping": 0.008,
    "initial_displacement_exponent": 1.7,
    "displacement_noise_std": 0.01,
    "force_noise_std": 0.05,
}
FIXED = {"noise_adaptation": "fixed", "change_detection": "none"}
LONE = {"innovation_window": 1, "window_includes_present": False}
SPREAD = {"alpha": 0.9, "beta": 1.5, "kappa": 0.5}
CASES = [
    ("ukf", FIXED),
    ("ukf", FIXED | SPREAD),
    ("rwstukf", FIXED | LONE | {"mahalanobis_threshold": 1.0}),
    ("rwstukf", FIXED | LONE | {"mahalanobis_threshold": 2.0, "scaling_form": "absolute"}),
    ("aukf", {"adapted_noise": "measurement", "matching_window": 25}),
    ("aukf", {"adapted_noise": "process", "matching_window": 25}),
    ("raukf", {"adapted_noise": "measurement", "change_detection": "none"}),
    ("raukf", {"adapted_noise": "both", "change_detection": "none"}),
    (
        "raukf",
        {"adapted_noise": "measurement", "change_detection": "none", "matching_trace": "literal"},
    ),
    (
        "raukf",
        {"adapted_noise": "process", "change_detection": "none", "matching_trace": "literal"},
    ),
]


def compare(samples, filter_name, state_space, contact_model, options):
    """Run filter and oracle over the samples, hold them together; both for further questions."""
    estimator = hc.create_estimator(
        filter_name, state_space=state_space, contact_model=contact_model, **options
    )
    series = estimator.run(*samples)
    space = {"kinematic": Kinematic, "paper": Paper}[state_space]
    configuration = estimator.configuration
    oracle = Oracle(space(configuration, contact_model == "adhesive"), configuration, filter_name)
    expected = np.array([oracle.step(*sample) for sample in zip(*samples, strict=True)])
    found = np.column_stack(
        [series.parameters, series.force_predicted, series.innovation, series.nis]
    )
    assert np.all(series.rejected == 0)
    np.testing.assert_allclose(found, expected[:, :-1], rtol=2e-6, atol=1e-8)
    np.testing.assert_allclose(series.force_noise_std[-1], np.sqrt(oracle.R[1, 1]), rtol=1e-6)
    np.testing.assert_allclose(series.process_noise_scale[-1], oracle.scale, rtol=1e-6)
    return series, expected


@pytest.mark.parametrize("state_space", ["kinematic", "paper"])
@pytest.mark.parametrize(("filter_name", "options"), CASES)
def test_filter_equals_the_plain_implementation(recording, filter_name, options, state_space):
    samples = recording(0.3, displacement_noise=0.01, force_noise=0.05)
    series, expected = compare(
        samples, filter_name, state_space, "hunt_crossley", COMMON | NEAR | options
    )
    if filter_name == "rwstukf":
        assert np.sum(expected[:, -1] != 1) > 10  # the scaling was at work
    if filter_name == "raukf" and options["adapted_noise"] != "process":
        noise, scale = series.force_noise_std, series.process_noise_scale
        assert noise[-1] != noise[0] or scale[-1] != scale[0]  # the matching was at work


@pytest.mark.parametrize("contact_model", ["hunt_crossley", "adhesive"])
@pytest.mark.parametrize("state_space", ["kinematic", "paper"])
def test_separation_and_tension_equal_the_plain_implementation(
    recording, contact_model, state_space
):
    """A third of the samples in separation, or in tension where the tissue sticks."""
    adhesive = contact_model == "adhesive"
    samples = recording(
        0.6,
        parameters=(0.2, 0.05, 1.8, 1.05),
        displacement_noise=0.01,
        force_noise=0.05,
        adhesive=adhesive,
    )
    compare(samples, "ukf", state_space, contact_model, COMMON | NEAR | FIXED)
    clean = recording(0.6, parameters=(0.2, 0.05, 1.8, 1.05), force_noise=0.0, adhesive=adhesive)[2]
    assert 0.2 < np.mean(clean < 0.0 if adhesive else clean == 0.0) < 0.5
