"""Small depth images, in texels of parallax."""

import numpy as np

SIZE = 24


def image(seed, size=SIZE):
    """A plane, boxes before it, noise, and nothing here and there."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size]
    parallax = 5 + x * rng.uniform(-0.1, 0.1) + y * rng.uniform(-0.1, 0.1)
    for _ in range(rng.integers(0, 4)):
        (a, b), (c, d) = np.sort(rng.integers(0, size, (2, 2)), axis=1)
        parallax[a : b + 1, c : d + 1] = rng.uniform(5, 60)
    parallax += rng.normal(0, rng.choice([0.0, 0.05]), parallax.shape)
    shown = np.ones((size, size), bool)
    for _ in range(rng.integers(0, 4)):
        a, c = rng.integers(0, size, 2)
        shown[a : a + 8, c : c + 8] = False
    return np.maximum(parallax, 0.1), shown
