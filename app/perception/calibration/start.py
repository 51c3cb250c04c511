"""Initial estimate of H Y = X C in closed form, from views that agree with each other.

Two views i and j give A X = X B with A = Hj Hi^-1 and B = Cj Ci^-1. Rotations first (Park and Martin 1994): the axes of
A are those of B rotated by X. Then the translation, which is linear. As a fifth of the views may be wrong, many sets of
three views are tried, and the one with the smallest median disagreement counts (Rousseeuw 1984).
"""

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float64

from app.perception.calibration.chain import Ends
from app.perception.calibration.se3 import Transforms, angle, inverse, log, mean, nearest_rotation, transform

_TRIALS = 400
_AGREE_M, _AGREE_RAD = 0.010, np.radians(1.0)
"""Weights of translation and rotation in a comparison of views: a centimetre counts as a degree, for a board of 0.25
m."""
_WITHIN = 4.0
"""Inlier threshold of the initial estimate, in median disagreements. The refinement uses all views again."""
_LEAST = 2.0
"""Least inlier threshold, in units of a centimetre and a degree: three views alone err by as much."""


def start(H: Float64[np.ndarray, "V 4 4"], C: Float64[np.ndarray, "V 4 4"], rng: np.random.Generator) -> Ends:
    """Initial estimate of both ends of the chain. Needs three views, rotated about more than one axis."""
    sets = _sets_of_three(len(H), rng)
    pairs = sets[:, [[0, 1], [0, 2], [1, 2]]]
    tried = closed_form(H, C, pairs)
    wrong = _disagreement(H, C, tried, sets)
    best = int(np.argmin(np.median(wrong, axis=1)))
    agreeing = wrong[best] <= max(_WITHIN * float(np.median(wrong[best])), _LEAST)
    return of_all(H, C, agreeing)


def of_all(H: Float64[np.ndarray, "V 4 4"], C: Float64[np.ndarray, "V 4 4"], of: Bool[np.ndarray, " V"]) -> Ends:
    """Closed-form estimate from all pairs of the views selected by the mask `of`."""
    pairs = np.array(list(combinations(np.flatnonzero(of), 2)))
    X = closed_form(H, C, pairs[None])[0]
    return Ends(X=X, Y=mean((inverse(H) @ X @ C)[of]))


def closed_form(
    H: Float64[np.ndarray, "V 4 4"], C: Float64[np.ndarray, "V 4 4"], pairs: np.ndarray
) -> Float64[np.ndarray, "T 4 4"]:
    """X for each set of pairs of views, `pairs (T, P, 2)`."""
    i, j = pairs[..., 0], pairs[..., 1]
    A, B = H[j] @ inverse(H[i]), C[j] @ inverse(C[i])
    alpha, beta = log(A[..., :3, :3]), log(B[..., :3, :3])
    R = nearest_rotation(np.swapaxes(alpha, -1, -2) @ beta)
    rows = (A[..., :3, :3] - np.eye(3)).reshape(len(pairs), -1, 3)
    right = ((R[:, None] @ B[..., :3, 3:])[..., 0] - A[..., :3, 3]).reshape(len(pairs), -1)
    return transform(R, (np.linalg.pinv(rows, rcond=1e-4) @ right[..., None])[..., 0])


def _sets_of_three(count: int, rng: np.random.Generator) -> np.ndarray:
    """All sets of three views where these are few, otherwise a random selection."""
    every = np.array(list(combinations(range(count), 3)))
    return every if len(every) <= _TRIALS else every[rng.choice(len(every), _TRIALS, replace=False)]


def _disagreement(
    H: Float64[np.ndarray, "V 4 4"], C: Float64[np.ndarray, "V 4 4"], X: Transforms, sets: np.ndarray
) -> Float64[np.ndarray, "T V"]:
    """Disagreement of each view's Y with that of the three views, in units of a centimetre and a degree."""
    Y = inverse(H) @ X[:, None] @ C
    own = mean(Y[np.arange(len(sets))[:, None], sets])
    off = inverse(own)[:, None] @ Y
    return np.hypot(np.linalg.norm(off[..., :3, 3], axis=-1) / _AGREE_M, angle(off[..., :3, :3]) / _AGREE_RAD)
