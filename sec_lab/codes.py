"""Spatial relations and the thesis's encodings of them.

Inside the workbench a relation is always a :class:`Relation` code (§2.3). The thesis writes relations in three more
ways, which are translated here, at the borders: letters N/T/A (§2.10.1), words (A.2) and 0/1 (LABEX tables, §4.2.1).
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Relations = NDArray[np.uint8]


class Relation(IntEnum):
    """Spatial relation between two segments (§2.3).

    Examples
    --------
    >>> Relation(2)
    <Relation.TOUCHING: 2>
    """

    NON_TOUCHING = 0
    OVERLAPPING = 1
    TOUCHING = 2
    ABSENT = 9


WORD_OF: Mapping[Relation, str] = {
    Relation.NON_TOUCHING: "NoConnection",
    Relation.OVERLAPPING: "Overlapping",
    Relation.TOUCHING: "Touching",
    Relation.ABSENT: "Absence",
}
"""Words of the GraphML dialect (A.2)."""

LETTER_OF: Mapping[Relation, str] = {
    Relation.NON_TOUCHING: "N",
    Relation.OVERLAPPING: "T",
    Relation.TOUCHING: "T",
    Relation.ABSENT: "A",
}
"""Letters of §2.10.1, where *overlapping* is read as *touching* seen in another way."""

_RELATION_OF_WORD = {word: relation for relation, word in WORD_OF.items()}
_RELATION_OF_LETTER = {"N": Relation.NON_TOUCHING, "T": Relation.TOUCHING, "A": Relation.ABSENT}


def as_array(values: ArrayLike, *, what: str, ndim: int | None = None) -> NDArray[Any]:
    """Numeric array of the given number of dimensions, or one clear error.

    Raises
    ------
    ValueError
        If the rows are ragged, the values are not numbers, or the number of dimensions is another.

    Examples
    --------
    >>> as_array([[0, 1], [2]], what="relations")
    Traceback (most recent call last):
    ...
    ValueError: relations: expected a rectangular array of numbers, got ragged rows
    """
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{what}: expected a rectangular array of numbers, got ragged rows") from error
    if array.dtype.kind not in "buif":
        raise ValueError(f"{what}: expected numbers, got values of type {array.dtype}")
    if ndim is not None and array.ndim != ndim:
        raise ValueError(f"{what}: expected {ndim} dimensions, got shape {array.shape}")
    return array


def as_integers(values: ArrayLike, *, what: str, ndim: int | None = None) -> NDArray[np.int64]:
    """Copy of an array of whole numbers as int64, or one clear error.

    Raises
    ------
    ValueError
        If a value is NaN, infinite or not whole, or for the reasons of :func:`as_array`.

    Examples
    --------
    >>> as_integers([1.0, 2.0], what="segments")
    array([1, 2])
    >>> as_integers([1.5], what="segments")
    Traceback (most recent call last):
    ...
    ValueError: segments: expected whole numbers, got 1.5
    """
    array = as_array(values, what=what, ndim=ndim)
    if array.dtype.kind == "f":
        wrong = ~(np.isfinite(array) & (array == np.round(array)) & (np.abs(array) < 2.0**53))
        if wrong.any():
            raise ValueError(f"{what}: expected whole numbers, got {array[wrong].flat[0]}")
    elif array.dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise ValueError(f"{what}: expected numbers below 2**63, got {array.max()}")
    return array.astype(np.int64)


def as_relations(values: ArrayLike, *, what: str = "relations", ndim: int | None = None) -> Relations:
    """Copy of an array of relation codes as uint8, or one clear error.

    Parameters
    ----------
    values : array_like of {0, 1, 2, 9}
    what : str, optional
        Name of the array in the error message.
    ndim : int, optional
        Number of dimensions that is expected; any if left out.

    Raises
    ------
    ValueError
        If a value is not a :class:`Relation`, or the shape is another than expected.

    Examples
    --------
    >>> as_relations([[0, 2], [9, 1]])
    array([[0, 2],
           [9, 1]], dtype=uint8)
    >>> as_relations([0, 3])
    Traceback (most recent call last):
    ...
    ValueError: relations: expected codes 0, 1, 2 or 9, got 3
    """
    array = as_array(values, what=what, ndim=ndim)
    # Large tables come as bytes already; they need not be widened first.
    integers = array if array.dtype == np.uint8 else as_integers(array, what=what)
    unknown = (integers > 2) & (integers != 9)
    if integers.dtype != np.uint8:
        unknown |= integers < 0
    if unknown.any():
        raise ValueError(f"{what}: expected codes 0, 1, 2 or 9, got {integers[unknown].flat[0]}")
    return integers.astype(np.uint8)


def from_words(words: Sequence[str]) -> Relations:
    """Relation codes of the words of A.2.

    Raises
    ------
    ValueError
        If a word is unknown.

    Examples
    --------
    >>> from_words(["NoConnection", "Touching"])
    array([0, 2], dtype=uint8)
    """
    return _translate(words, _RELATION_OF_WORD)


def from_letters(letters: Sequence[str]) -> Relations:
    """Relation codes of the letters N, T and A of §2.10.1 (a string or a sequence of letters).

    Raises
    ------
    ValueError
        If a letter is unknown.

    Examples
    --------
    >>> from_letters("ANTTNA")
    array([9, 0, 2, 2, 0, 9], dtype=uint8)
    """
    return _translate(letters, _RELATION_OF_LETTER)


def to_letters(relations: ArrayLike) -> str:
    """Letters N, T and A of one row of relations; overlapping is written T (§2.10.1).

    Examples
    --------
    >>> to_letters([9, 0, 2, 1, 0, 9])
    'ANTTNA'
    """
    return "".join(LETTER_OF[Relation(code)] for code in as_relations(relations, ndim=1).tolist())


def from_binary(table: ArrayLike) -> Relations:
    """Relation codes of a table in which 1 means touching, 0 non-touching (§4.2.1) and 9 absent.

    Raises
    ------
    ValueError
        If a value is not 0, 1 or 9.

    Examples
    --------
    >>> from_binary([[0, 1, 9]])
    array([[0, 2, 9]], dtype=uint8)
    """
    integers = as_integers(table, what="0/1 table")
    unknown = ~np.isin(integers, (0, 1, 9))
    if unknown.any():
        raise ValueError(f"0/1 table: expected 0, 1 or 9, got {integers[unknown].flat[0]}")
    return np.where(integers == 1, Relation.TOUCHING, integers).astype(np.uint8)


def to_binary(relations: ArrayLike) -> Relations:
    """Table in which 1 means that two segments touch or overlap, 0 that they do not, 9 that one is absent.

    Examples
    --------
    >>> to_binary([[0, 1, 2, 9]])
    array([[0, 1, 1, 9]], dtype=uint8)
    """
    codes = as_relations(relations)
    return np.where(codes == Relation.TOUCHING, 1, codes).astype(np.uint8)


def _translate(symbols: Sequence[str], dictionary: Mapping[str, Relation]) -> Relations:
    unknown = [symbol for symbol in symbols if not isinstance(symbol, str) or symbol not in dictionary]
    if unknown:
        raise ValueError(f"relations: expected {', '.join(dictionary)}, got {unknown[0]!r}")
    return np.array([dictionary[symbol] for symbol in symbols], dtype=np.uint8)
