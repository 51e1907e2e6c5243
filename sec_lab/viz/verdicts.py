"""What the thesis says, what comes out here, and whether they agree: the table that ends every chapter's notebook."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

AGREES, DIFFERS = "agrees", "differs"


@dataclass(frozen=True, eq=False)
class Finding:
    """One value of the thesis and ours.

    Parameters
    ----------
    what : str
        What the value is.
    thesis, ours : number, str, bool, mapping, or array_like
        A bool is a statement that holds or does not.
    tolerance : float, optional
        Largest difference of numbers that counts as agreement: half a unit of the last digit that the thesis prints,
        as a rule.
    unit : str, optional
        Written behind both numbers.
    """

    what: str
    thesis: Any
    ours: Any
    tolerance: float = 0.0
    unit: str = ""


def verdict_table(findings: Iterable[Finding]) -> "pd.DataFrame":
    """Table *thesis value, ours, verdict*, the verdicts being computed.

    Arrays and mappings are compared entry by entry; the verdict then says how many entries agree.

    Parameters
    ----------
    findings : iterable of Finding

    Returns
    -------
    pandas.DataFrame
        Columns ``thesis``, ``ours`` and ``verdict``, all text; one row a finding.

    Raises
    ------
    ValueError
        If there is no finding, a tolerance is negative, or two values cannot be compared.

    Examples
    --------
    >>> verdict_table([Finding("main graphs", 5, 5), Finding("similarity", 84, 83.9, tolerance=0.5, unit=" %")])
                thesis    ours verdict
    main graphs      5       5  agrees
    similarity    84 %  83.9 %  agrees
    """
    import pandas as pd

    listed = list(findings)
    if not listed:
        raise ValueError("verdicts: expected at least one finding, got none")
    return pd.DataFrame(
        {
            "thesis": [_shown(finding.thesis, finding.unit) for finding in listed],
            "ours": [_shown(finding.ours, finding.unit) for finding in listed],
            "verdict": [verdict(finding) for finding in listed],
        },
        index=[finding.what for finding in listed],
    )


def verdict(finding: Finding) -> str:
    """``"agrees"`` or ``"differs"``, for arrays and mappings with the number of entries that agree.

    Examples
    --------
    >>> verdict(Finding("segments", {1: 1, 2: 6}, {1: 1, 2: 5}))
    'differs (1/2)'
    """
    if not finding.tolerance >= 0:
        raise ValueError(f"tolerance: expected a number from 0 on, got {finding.tolerance}")
    thesis, ours = finding.thesis, finding.ours
    if isinstance(thesis, Mapping) and isinstance(ours, Mapping):
        keys = list(dict.fromkeys([*thesis, *ours]))
        agreeing = [key in thesis and key in ours and _same(thesis[key], ours[key], finding) for key in keys]
    elif _is_scalar(thesis) and _is_scalar(ours):
        return AGREES if _same(thesis, ours, finding) else DIFFERS
    elif isinstance(thesis, Mapping) or isinstance(ours, Mapping) or _is_scalar(thesis) or _is_scalar(ours):
        raise ValueError(f"{finding.what}: expected two values of one kind, got {thesis!r} and {ours!r}")
    else:
        expected, found = np.asarray(thesis), np.asarray(ours)
        if expected.shape != found.shape:
            return f"{DIFFERS} (shape)"
        agreeing = [_same(a, b, finding) for a, b in zip(expected.flat, found.flat, strict=True)]
    return f"{AGREES if all(agreeing) else DIFFERS} ({sum(agreeing)}/{len(agreeing)})"


def _is_scalar(value: Any) -> bool:
    return isinstance(value, str) or (np.ndim(value) == 0 and not isinstance(value, Mapping))


def _same(thesis: Any, ours: Any, finding: Finding) -> bool:
    if isinstance(thesis, str) or isinstance(ours, str):
        return bool(thesis == ours)
    return bool(abs(float(thesis) - float(ours)) <= finding.tolerance)


def _shown(value: Any, unit: str) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return ", ".join(f"{key}≈{one}" for key, one in value.items())
    if _is_scalar(value):
        return f"{value:.4g}{unit}" if isinstance(value, float | np.floating) else f"{value}{unit}"
    array = np.asarray(value)
    if array.size <= 6:
        return ", ".join(f"{one:.4g}" if isinstance(one, float) else str(one) for one in array.ravel().tolist()) + unit
    return "×".join(map(str, array.shape)) + " entries"
