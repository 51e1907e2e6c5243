"""What each rule of relations over time does to the chain of a movie, shown one by one (§2.3, §2.5)."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from sec_lab.chain_agreement import chain_agreement
from sec_lab.observation import Observation
from sec_lab.pipeline import observe
from sec_lab.recording import Recording
from sec_lab.relations.over_time import steady_relations
from sec_lab.relations.time_parameters import PICTURE_ALONE, TimeParameters
from sec_lab.segmentation import Segmentation
from sec_lab.worlds.tabletop.observed import TABLE, ObservedMovie, chain_size

if TYPE_CHECKING:
    import pandas as pd

_DEFAULT = TimeParameters()

NO_RULE = replace(PICTURE_ALONE, contact_by_motion=False, carried=False, kind_at_rest=False)
"""Every picture for itself, and nothing that hangs on motion."""

RULES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "two thresholds": ("touching_thresholds", "overlapping_thresholds"),
        "changes must last": ("hysteresis_frames",),
        "segments must live": ("min_life_frames",),
        "hidden segments are held": ("hold_frames", "leaving_share", "crumb_share"),
        "depth parts": ("step_m",),
        "smear is no contact": ("smear_spreads",),
        "hardly visible says nothing": ("visible_share",),
        "contact by motion": ("rest_px", "contact_by_motion"),
        "carried things touch": ("carried",),
        "overlapping at rest only": ("kind_at_rest",),
        "a pause is no contact": ("pause_frames",),
        "changes together": ("together_frames",),
    }
)
"""The parameters of :class:`~sec_lab.relations.time_parameters.TimeParameters` that make each rule."""


def one_by_one() -> dict[str, TimeParameters]:
    """No rule, then one more each time, in the order of :data:`RULES`, until all are on.

    Examples
    --------
    >>> steps = one_by_one()
    >>> list(steps)[:2], steps["changes together"] == TimeParameters()
    (['none', 'two thresholds'], True)
    """
    steps = {"none": NO_RULE}
    for rule, names in RULES.items():
        # Rules that hang on motion have nothing to hang on before it is measured.
        steps[rule] = replace([*steps.values()][-1], **_values(_DEFAULT, names))
    return steps


def all_but_one() -> dict[str, TimeParameters]:
    """All rules, and all of them but one.

    Examples
    --------
    >>> all_but_one()["changes must last"].hysteresis_frames
    0
    """
    # Motion stays measured: the rules after it are not switched off with it.
    off = {
        rule: replace(_DEFAULT, **_values(NO_RULE, [name for name in names if name != "rest_px"]))
        for rule, names in RULES.items()
    }
    return {"none": _DEFAULT, **off}


def _values(parameters: TimeParameters, names: Any) -> dict[str, Any]:
    return {name: getattr(parameters, name) for name in names}


def rule_table(movie: ObservedMovie, *, source: str) -> "pd.DataFrame":
    """Size of the chain, and how it agrees with that from the truth, as the rules come and as each is missing.

    Parameters
    ----------
    movie : ObservedMovie
    source : {"pixels", "truth"}
        Whose labels and depth are looked at.

    Returns
    -------
    pandas.DataFrame
        One row a rule, after one without any. Columns of two levels: ``with it and those above`` and ``all but it``
        (in the first row: none of them is missing); of each ``columns``, ``changing rows``, and ``agreement`` with
        the chain from the truth under all rules, in percent.

    Raises
    ------
    ValueError
        If the source is unknown.
    """
    import pandas as pd

    if source not in ("pixels", "truth"):
        raise ValueError(f"source: expected 'pixels' or 'truth', got {source!r}")
    if source == "pixels":
        recording, labels = movie.found_recording, Segmentation.from_labels(movie.labels)
    else:
        recording, labels = movie.true_recording, Segmentation.from_labels(movie.true.labels, background=TABLE)
    parts = {"with it and those above": one_by_one(), "all but it": all_but_one()}
    measured = {
        part: {rule: _measured(recording, labels, rules, movie.truth) for rule, rules in variants.items()}
        for part, variants in parts.items()
    }
    frames = {part: pd.DataFrame.from_dict(rows, orient="index") for part, rows in measured.items()}
    table = pd.concat(frames, axis=1)
    table.index.name = "rule"
    return table


def _measured(
    recording: Recording, labels: Segmentation, rules: TimeParameters, truth: Observation
) -> dict[str, float | int]:
    seen = observe(recording, segmentation=labels, over_time=partial(steady_relations, parameters=rules))
    rows, columns = chain_size(seen)
    agreement = chain_agreement(seen, truth).mean
    return {"columns": columns, "changing rows": rows, "agreement": round(agreement)}
