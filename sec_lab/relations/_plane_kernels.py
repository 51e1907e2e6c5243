"""Compiled planes of segments for :mod:`sec_lab.relations.over_time`: what is nearer than its plane may be smear."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from sec_lab.relations._border_kernels import Depth, Planes
from sec_lab.relations._kernels import Codes, Integers

_ROUNDS = 5
_CLOSE = 2.0
"""Standard deviations from the plane up to which something counts: 95 % of what is normal, hardly any smear."""

_LEAST_PIXELS = 30
_LEAST_DETERMINANT = 1e-12
"""Of second moments in shares of the picture: what is less lies on a line."""

_LEAST_VARIANCE = 1e-12
"""In 1/m²: exact depth is one of single precision."""


def no_planes(n: int) -> Planes:
    """Planes of n segments of which nothing is known, (n, 4) float64: nothing is nearer than they allow."""
    planes = np.zeros((n, 4))
    planes[:, 3] = np.inf
    return planes


@nb.njit(cache=True, nogil=True)
def planes_of(codes: Codes, width: int, labels: Integers, depth_m: Depth, spreads: float) -> Planes:
    """Plane through each segment, by least squares over what lies close to it; inverse depth of a plane is linear.

    Parameters
    ----------
    codes, width, labels
        As of :func:`sec_lab.relations._kernels.count_hints`.
    depth_m : (height, width) float32
        Metres; 0 is unknown.
    spreads : float
        By so many standard deviations of what lies close to its plane may something be nearer.

    Returns
    -------
    (n, 4) float64
        a, b, c, d of every segment: inverse depth a x + b y + c, with x and y in shares of the width and of the height,
        from the left and from the top, and the largest excess d that is allowed, in 1/m; 0, 0, 0 and infinite without a
        plane: if of the pixels looked at, every second one each way or fewer, less than 30 lie close to one.
    """
    height, n = codes.shape[0], len(labels)
    # So many pixels are enough for a plane, however large the picture is.
    step = max(2, min(height, width) // 128)
    segment_of = np.zeros(2 ** (8 * codes.itemsize), np.int64)
    for i in range(n):
        segment_of[labels[i]] = i
    found = np.zeros((n, 4))
    found[:, 3] = np.inf
    told = np.ones(n, np.bool_)
    for _ in range(_ROUNDS):
        sums = np.zeros((n, 10))
        for row in range(0, height, step):
            y = row / height
            for column in range(0, width, step):
                depth = depth_m[row, column]
                if depth <= 0:
                    continue
                i = segment_of[codes[row, column]]
                if not told[i]:
                    continue
                x, inverse = column / width, 1.0 / depth
                plane, total = found[i], sums[i]
                if abs(inverse - (plane[0] * x + plane[1] * y + plane[2])) > plane[3]:
                    continue
                total[0] += 1
                total[1] += x
                total[2] += y
                total[3] += inverse
                total[4] += x * x
                total[5] += x * y
                total[6] += y * y
                total[7] += x * inverse
                total[8] += y * inverse
                total[9] += inverse * inverse
        for i in range(n):
            told[i] = told[i] and _fitted(sums[i], found[i])
    for i in range(n):
        if told[i]:
            found[i, 3] *= spreads / _CLOSE
        else:
            found[i, :3] = 0
            found[i, 3] = np.inf
    return found


@nb.njit(cache=True, nogil=True)
def _fitted(total: NDArray[np.float64], plane: NDArray[np.float64]) -> bool:
    """Least squares from sums, if there is a plane; what may be nearer than it becomes what still lies close to it."""
    n = total[0]
    if n < _LEAST_PIXELS:
        return False
    x, y, v = total[1] / n, total[2] / n, total[3] / n
    xx, xy, yy = total[4] / n - x * x, total[5] / n - x * y, total[6] / n - y * y
    xv, yv, vv = total[7] / n - x * v, total[8] / n - y * v, total[9] / n - v * v
    determinant = xx * yy - xy * xy
    if determinant < _LEAST_DETERMINANT:
        return False
    a, b = (xv * yy - yv * xy) / determinant, (yv * xx - xv * xy) / determinant
    plane[0], plane[1], plane[2] = a, b, v - a * x - b * y
    plane[3] = _CLOSE * np.sqrt(max(vv - a * xv - b * yv, _LEAST_VARIANCE))
    return True
