"""How much a chain from pixels says the same as the chain from the truth (step 5 turned on ourselves)."""

from dataclasses import dataclass

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.similarity import EFFORT, Normalizer, compare


@dataclass(frozen=True)
class ChainAgreement:
    """Temporal similarity of two chains in percent, in both directions.

    Attributes
    ----------
    found_again : float
        ξ¹ is the truth: rows of the chain from pixels that the truth does not have are ignored, rows that it lacks
        cost.
    to_the_point : float
        ξ¹ is the chain from pixels: each row too many costs, rows that it lacks are ignored.
    """

    found_again: float
    to_the_point: float

    @property
    def mean(self) -> float:
        """Mean of both directions, so that neither missing nor spurious rows come for free."""
        return (self.found_again + self.to_the_point) / 2


def chain_agreement(
    pixels: EventChain | Observation,
    truth: EventChain | Observation,
    *,
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    effort: int = EFFORT,
) -> ChainAgreement:
    """Compare what was seen in pixels with what is true (ψ_temporal, Eq. 2.9).

    Parameters
    ----------
    pixels, truth : EventChain or Observation
        Of an observation its chain.
    normalizer, tolerance_percent, effort
        As in :func:`~sec_lab.similarity.compare`, with the same defaults: the longer row divides, as printed in
        Eq. 2.2.

    Returns
    -------
    ChainAgreement
        100 percent in both directions if nothing changes in either; 0 if something changes in one of them only, which
        also holds for observations of fewer than two segments, as these have no chain.

    Raises
    ------
    ValueError
        If an observation has no content, or an option is unknown.

    Examples
    --------
    The truth has two rows that change, of which the chain from pixels has one:

    >>> truth = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (1, 3)])
    >>> pixels = EventChain([[0, 2, 2]], [(7, 8)])
    >>> agreement = chain_agreement(pixels, truth)
    >>> agreement.found_again, agreement.to_the_point, agreement.mean
    (50.0, 100.0, 75.0)
    """
    a, b = _chain_of(pixels), _chain_of(truth)
    if a is None or b is None:
        same = 100.0 if a is b else 0.0
        return ChainAgreement(same, same)
    found_again, to_the_point = (
        compare(x, y, normalizer=normalizer, tolerance_percent=tolerance_percent, effort=effort).temporal
        for x, y in ((b, a), (a, b))
    )
    return ChainAgreement(found_again, to_the_point)


def same_chain(a: EventChain, b: EventChain) -> bool:
    """Whether two chains say the same of the same segments at the same frames; names may differ.

    Examples
    --------
    >>> one, other = EventChain([[0, 2]], [(1, 2)], [4, 9]), EventChain([[0, 2]], [(1, 2)], [4, 8])
    >>> same_chain(one, one), same_chain(one, other)
    (True, False)
    """
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("relations", "pairs", "key_frames"))


def _chain_of(seen: EventChain | Observation) -> EventChain | None:
    """The chain, unless nothing changes in it."""
    if isinstance(seen, Observation):
        if len(seen.segments) < 2:
            return None
        seen = seen.chain
    return seen if len(seen.changing_rows) else None
