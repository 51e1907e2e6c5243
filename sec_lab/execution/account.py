"""What came of an execution, for those who look on: rows that agree with the model, verdicts as sentences, moments."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

from sec_lab.codes import LETTER_OF, Relation
from sec_lab.event_chain import EventChain
from sec_lab.execution.loop import Outcome, Verdict

Standing = Literal["agrees", "agrees with more between", "differs", "missing", "not in the model"]
"""How a row of an executed chain stands to the model."""


@dataclass(frozen=True)
class ComparedRow:
    """A relation in the model and in the executed chain.

    Parameters
    ----------
    names : str
        Of both segments, such as "red box, robot arm".
    model, executed : str
        Its changes in their order, such as "ANTNA"; empty where there is no such row.
    standing : str
        See :data:`Standing`.
    """

    names: str
    model: str
    executed: str
    standing: Standing


def compared_rows(model: EventChain, executed: EventChain | None) -> tuple[ComparedRow, ...]:
    """Rows of the model beside those of an executed chain, by the names of their segments (Fig. 2.21).

    Parameters
    ----------
    model : EventChain
    executed : EventChain or None
        None: nothing was seen.

    Returns
    -------
    tuple of ComparedRow
        Those of the model first, then those that only the executed chain has.

    Examples
    --------
    >>> names = {1: "arm", 2: "box", 3: "table"}
    >>> model = EventChain([[0, 2, 0]], [(1, 2)], names=names)
    >>> [row.standing for row in compared_rows(model, EventChain([[0, 2, 2]], [(1, 2)], names=names))]
    ['differs']
    """
    wanted, got = _changes(model), {} if executed is None else _changes(executed)
    rows = []
    for names, letters in wanted.items():
        seen = got.pop(names, "")
        rows.append(ComparedRow(names, letters, seen, _standing(letters, seen)))
    return (*rows, *(ComparedRow(names, "", letters, "not in the model") for names, letters in got.items()))


def verdict_sentence(verdict: Verdict) -> str:
    """What the arm said of itself after a rule, as a sentence.

    Parameters
    ----------
    verdict : Verdict

    Examples
    --------
    >>> verdict_sentence(Verdict(0, "{red box, robot arm} N→T", 150, True, ""))
    'Attempt 1, frame 150, after {red box, robot arm} N→T: the chain so far is the model’s.'
    """
    said = "the chain so far is the model’s" if verdict.agrees else f"recognised as a failure: {verdict.why}"
    return f"Attempt {verdict.attempt + 1}, frame {verdict.frame}, after {verdict.rule}: {said}."


def outcome_sentence(outcome: Outcome) -> str:
    """How an execution ended by the arm's own verdict and by the truth.

    Parameters
    ----------
    outcome : Outcome
    """
    one, other = (thing.name for thing in outcome.scene.things[:2]) if len(outcome.scene.things) > 1 else ("", "")
    tried = f"{outcome.n_attempts} attempt{'s' if outcome.n_attempts != 1 else ''}, {outcome.time_s:.0f} s simulated"
    said = f"The arm says that it is done ({tried})"
    if not outcome.success:
        said = f"The arm says that it failed ({tried}): {outcome.gave_up}"
    if not one:
        return f"{said}; a thing is gone."
    touch = bool(outcome.truth.touching(one, other)[-1])
    return f"{said}; in the simulator {one} and {other} {'touch' if touch else 'do not touch'}."


def moments(outcome: Outcome) -> tuple[tuple[int, str], ...]:
    """Frames of an execution that are worth seeing: the first, and the look after every rule, with what each is.

    Parameters
    ----------
    outcome : Outcome

    Returns
    -------
    tuple of (int, str)
        Frame numbers in the whole recording, of the last attempt.
    """
    n_watched = len(next(iter(outcome.perceived.gaps_m.values())))
    start, last = len(outcome.recording) - n_watched, outcome.verdicts[-1].attempt
    looks = [(start + one.frame - 1, f"after {one.rule}") for one in outcome.verdicts if one.attempt == last]
    return ((0, "start"), *looks)


def refusal_sentence(message: str) -> str:
    """Why nothing was tried, as a sentence.

    Parameters
    ----------
    message : str
        Of the error.

    Examples
    --------
    >>> refusal_sentence("scene: expected one candidate for 'red box', got 2")
    'Refused, the arm has not moved: expected one candidate for ‘red box’, got 2.'
    """
    words = " ".join(message.split()).removeprefix("scene: ")
    words = re.sub(r"'([^']*)'", r"‘\1’", words)
    return f"Refused, the arm has not moved: {words.rstrip('.')}."


def _changes(chain: EventChain) -> dict[str, str]:
    return {
        ", ".join(sorted(chain.row_label(row).split(", "))): "".join(letter for letter, _ in groupby(_letters(codes)))
        for row, codes in enumerate(chain.relations)
    }


def _letters(codes: Sequence[int]) -> str:
    return "".join(LETTER_OF[Relation(int(code))] for code in codes)


def _standing(wanted: str, got: str) -> Standing:
    if not got:
        return "missing"
    if got == wanted:
        return "agrees"
    letters = iter(got)
    # As in the self-check: a contact that is lost and found again between is no failure.
    if got[-1] == wanted[-1] and all(letter in letters for letter in wanted):
        return "agrees with more between"
    return "differs"
