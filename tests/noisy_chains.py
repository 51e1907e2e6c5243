"""Seeds and noisy samples of them, as §3.1 makes them: rows and columns are added, and entries flipped."""

import numpy as np
from numpy.typing import NDArray

from sec_lab.event_chain import EventChain

RELATIONS = np.array([0, 2, 9], np.uint8)


def seed(n_rows: int, n_columns: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A chain in which every row changes and neighbouring columns differ."""
    while True:
        rows = RELATIONS[rng.integers(0, 3, (n_rows, n_columns))]
        stays = rng.random(rows.shape) < 0.5
        for x in range(1, n_columns):
            rows[:, x] = np.where(stays[:, x], rows[:, x - 1], rows[:, x])
        if (rows != rows[:, :1]).any(axis=1).all() and (rows[:, 1:] != rows[:, :-1]).any(axis=0).all():
            return rows


def sample(rows: NDArray[np.uint8], p: float, rng: np.random.Generator, *, flip: bool = False) -> EventChain:
    """A noisy sample: after each row and column one may be added with probability p; the rows are shuffled."""
    noisy = rows.copy()
    if flip:
        other = RELATIONS[(np.searchsorted(RELATIONS, rows) + rng.integers(1, 3, rows.shape)) % 3]
        noisy = np.where(rng.random(rows.shape) < p, other, rows)
    noisy = _added(_added(noisy, p, rng).T, p, rng).T
    noisy = noisy[rng.permutation(len(noisy))]
    return EventChain(noisy, [(2 * i, 2 * i + 1) for i in range(len(noisy))])


def _added(rows: NDArray[np.uint8], p: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    lines = []
    for row in rows:
        lines.append(row)
        if rng.random() < p:
            lines.append(RELATIONS[rng.integers(0, 3, rows.shape[1])])
    return np.array(lines, np.uint8)
