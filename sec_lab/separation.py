"""How well a table of similarities parts the types of manipulations: the numbers that §2.7 gives, and their like."""

from typing import TYPE_CHECKING, Any

import numpy as np

from sec_lab.classification import Classes, leave_one_out, threshold_errors, unsupervised_classes

if TYPE_CHECKING:
    import pandas as pd

_STEP_PERCENT = 0.5


def type_separation(table: "pd.DataFrame", classes: Classes) -> dict[str, Any]:
    """What §2.7 tells of its table, and a little more, of any symmetric table.

    Parameters
    ----------
    table : (n, n) pandas.DataFrame of float
        Similarities in percent, symmetric; at least three rows.
    classes : (n,) array_like
        Known type of each manipulation.

    Returns
    -------
    dict of str to number
        ``least within`` a type and ``most between`` types, in percent; ``fewest wrong`` pairs that any threshold
        leaves, and ``at`` which, in percent (the lowest of several, in steps of 0.5); ``classes`` that X-means finds,
        their adjusted ``Rand`` index (1: the types, 0: chance) and ``outliers``; ``nearest``: how many have a nearest
        neighbour of their own type.

    Raises
    ------
    ValueError
        As in :func:`~sec_lab.classification.threshold_errors`, or if all are of one type or none of the same.

    Examples
    --------
    >>> import pandas as pd
    >>> table = np.full((6, 6), 30.0)
    >>> table[:3, :3] = table[3:, 3:] = 80.0
    >>> np.fill_diagonal(table, 100.0)
    >>> found = type_separation(pd.DataFrame(table), ["put"] * 3 + ["take"] * 3)
    >>> found["least within"], found["most between"], found["fewest wrong"], found["at"], found["nearest"]
    (80.0, 30.0, 0, 30.5, 6)
    """
    from sklearn.metrics import adjusted_rand_score

    thresholds = np.arange(0, 100 + _STEP_PERCENT / 2, _STEP_PERCENT)
    wrong = threshold_errors(table, classes, thresholds_percent=thresholds).sum(axis=1)
    types = np.asarray(classes)
    values = table.to_numpy(dtype=np.float64)
    pairs = np.triu(np.ones(values.shape, dtype=bool), k=1)
    equal = types[:, None] == types
    if not (pairs & equal).any() or not (pairs & ~equal).any():
        raise ValueError(f"classes: expected pairs of one type and of two, got {sorted(set(types.tolist()))}")
    found = unsupervised_classes(table)
    return {
        "least within": float(values[pairs & equal].min()),
        "most between": float(values[pairs & ~equal].max()),
        "fewest wrong": int(wrong.min()),
        "at": float(thresholds[int(wrong.to_numpy().argmin())]),
        "classes": int(found.max()) + 1,
        "Rand": float(adjusted_rand_score(types, found)),
        "outliers": n_outliers(types, found),
        "nearest": int((leave_one_out(table, types) == types).sum()),
    }


def n_outliers(classes: Classes, found: Classes) -> int:
    """How many are in a class that was found in which another type is more frequent than their own.

    Parameters
    ----------
    classes, found : (n,) array_like
        Known types, and the classes that were found without knowing them. If several types are equally frequent in a
        class, all but one of them are outliers.

    Raises
    ------
    ValueError
        If the numbers differ.

    Examples
    --------
    >>> n_outliers(["put", "put", "take", "take"], [0, 0, 0, 1])
    1
    """
    import pandas as pd

    known, others = np.asarray(classes), np.asarray(found)
    if known.shape != others.shape:
        raise ValueError(f"found: expected {len(known)} classes, got {len(others)}")
    return int(len(known) - pd.crosstab(others, known).max(axis=1).sum())
