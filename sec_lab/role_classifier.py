"""Recognition by role tables, with the interface of scikit-learn."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import permutations
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.impute import SimpleImputer
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.utils.validation import check_is_fitted
from threadpoolctl import ThreadpoolController

from sec_lab.codes import Relation
from sec_lab.event_chain import EventChain
from sec_lab.observation import Observation
from sec_lab.role_tables import ROLES, ROWS, Cleaning, Compressed, RoleTable, role_similarity, role_table
from sec_lab.role_tables.table import as_role_table

Recording = RoleTable | Observation | EventChain

_CODES = (int(Relation.NON_TOUCHING), int(Relation.TOUCHING), int(Relation.ABSENT))
_PRESENCE_CODES = (_CODES[0], _CODES[2])
_MOST_COUNTED = 2
_MOST_DEVIATIONS = 3.0
_DEFAULT = Cleaning()


def feature_names() -> list[str]:
    """What each entry of :func:`role_features` is.

    Examples
    --------
    >>> len(feature_names()), feature_names()[:2]
    (96, ['hand – object 1 is 0 at first', 'hand – object 1 is 0 at last'])
    """
    names = []
    for row, codes, counted in _named_rows():
        names += [f"{row} is {code} at {end}" for code in codes for end in ("first", "last")]
        names += [f"{row} from {a} to {b}" for a, b in permutations(codes, 2)]
        names += [f"{row}: share of time in touch"] * counted
    return [*names, "vertical share of the motion of object 1"]


def _named_rows() -> list[tuple[str, tuple[int, ...], bool]]:
    relations = [(f"{ROLES[a]} – {ROLES[b]}", _CODES, True) for a, b in ROWS]
    return relations + [(f"{role} there", _PRESENCE_CODES, False) for role in ROLES]


def role_features(table: RoleTable, *, most_counted: int = _MOST_COUNTED) -> NDArray[np.float64]:
    """Numbers that describe a role table, named by :func:`feature_names`.

    Of each of the ten rows: which value it has at first and at last (one number a value, 0 or 1) and how often each
    value changes to each other one; of the five relations the share of time in touch; and the share of the motion of
    object 1 that goes up or down, NaN if it is not known.

    Parameters
    ----------
    table : RoleTable
    most_counted : int, optional
        Changes are counted up to this number: never, once, again and again.

    Returns
    -------
    (96,) float64

    Raises
    ------
    ValueError
        If it is no role table, or changes are counted up to less than 1.

    Examples
    --------
    >>> from sec_lab.role_tables import role_table
    >>> seen = EventChain([[9, 0, 2, 0, 9], [9, 0, 0, 0, 9], [0, 0, 0, 0, 0]], [(7, 1), (7, 2), (2, 1)])
    >>> found = dict(zip(feature_names(), role_features(role_table(seen)).tolist()))
    >>> found["hand – object 1 from 0 to 2"], found["hand – object 1: share of time in touch"]
    (1.0, 0.2)
    """
    as_role_table(table)
    if most_counted < 1:
        raise ValueError(f"most_counted: expected at least 1, got {most_counted}")
    shares = table.shares
    values: list[float] = []
    for row, (_, codes, counted) in zip(table.rows, _named_rows(), strict=True):
        values += [float(row[end] == code) for code in codes for end in (0, -1)]
        changes = list(zip(row[:-1].tolist(), row[1:].tolist(), strict=True))
        values += [float(min(changes.count(pair), most_counted)) for pair in permutations(codes, 2)]
        if counted:
            values.append(float(shares[row == Relation.TOUCHING].sum()))
    return np.array([*values, table.vertical_share])


# To look for the libraries that have threads takes longer than to fit; they stay the same.
@lru_cache(maxsize=1)
def _threads() -> ThreadpoolController:
    return ThreadpoolController()


# The same tables are learned from again and again where options are compared.
@lru_cache(maxsize=4096)
def _remembered_features(table: RoleTable, most_counted: int) -> NDArray[np.float64]:
    features = role_features(table, most_counted=most_counted)
    features.setflags(write=False)
    return features


class RoleTableClassifier(ClassifierMixin, BaseEstimator):
    """Recognise manipulations by their role tables: standardised logistic regression on :func:`role_features`.

    Features are brought to mean 0 and standard deviation 1, and cut off at three standard deviations.

    Parameters
    ----------
    C : float, optional
        Inverse strength of the regularisation, as in :class:`sklearn.linear_model.LogisticRegression`.
    cleaning : Cleaning, optional
        How recordings are cleaned; role tables are taken as they are.
    hands : sequence of int or str, optional
        As in :func:`~sec_lab.role_tables.role_table`.
    vertical : bool, optional
        Use the share of vertical motion. Where it is not known, the mean of the known ones stands in.
    most_counted : int, optional
        As in :func:`role_features`.
    without_hand : object, optional
        What a recording without a hand is recognised as. If left out, such a recording is an error: its role table says
        nothing, so any answer would be a guess.

    Attributes
    ----------
    classes_ : (n_classes,) ndarray
    model_ : sklearn.pipeline.Pipeline

    Examples
    --------
    >>> put = EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [0, 0, 0, 2, 2]], [(7, 1), (7, 2), (2, 1)])
    >>> take = EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], [(7, 1), (7, 2), (2, 1)])
    >>> model = RoleTableClassifier().fit([put, take, put, take], ["put", "take", "put", "take"])
    >>> model.predict([take, put]).tolist()
    ['take', 'put']
    """

    def __init__(
        self,
        *,
        C: float = 0.3,
        cleaning: Cleaning = _DEFAULT,
        hands: Sequence[int | str] | None = None,
        vertical: bool = True,
        most_counted: int = _MOST_COUNTED,
        without_hand: object = None,
    ) -> None:
        self.C = C
        self.cleaning = cleaning
        self.hands = hands
        self.vertical = vertical
        self.most_counted = most_counted
        self.without_hand = without_hand

    def fit(self, X: Sequence[Recording], y: ArrayLike) -> Self:
        """Learn from recordings (or their role tables) X and what they show, y, of shape (n,)."""
        known, usable, features = self._checked(X, y)
        self.classes_ = np.unique(known[usable])
        self.model_: Pipeline = make_pipeline(
            SimpleImputer(keep_empty_features=True),
            StandardScaler(),
            # What hardly ever happens lies many standard deviations off when it does; it shall not outvote the rest.
            FunctionTransformer(np.clip, kw_args={"a_min": -_MOST_DEVIATIONS, "a_max": _MOST_DEVIATIONS}),
            LogisticRegression(C=self.C, max_iter=2000),
        )
        with _threads().limit(limits=1):
            self.model_.fit(features[usable], known[usable])
        return self

    def predict(self, X: Sequence[Recording]) -> NDArray[Any]:
        """What each of the recordings shows, shape (n,)."""
        check_is_fitted(self)
        usable, features = self._features(X)
        if usable.all():
            return (
                np.asarray(self.classes_[self._scores(features).argmax(axis=1)]) if len(usable) else self.classes_[:0]
            )
        found: NDArray[Any] = np.full(len(usable), self.without_hand, dtype=object)
        if usable.any():
            found[usable] = self.classes_[self._scores(features[usable]).argmax(axis=1)]
        return _in_one_array(found.tolist(), self.classes_.dtype, self.without_hand)

    def predict_proba(self, X: Sequence[Recording]) -> NDArray[np.float64]:
        """Probability of each class, shape (n, n_classes); equal ones for a recording without a hand."""
        check_is_fitted(self)
        usable, features = self._features(X)
        found = np.full((len(usable), len(self.classes_)), 1.0 / len(self.classes_))
        if usable.any():
            found[usable] = self._scores(features[usable])
        return found

    def _scores(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        with _threads().limit(limits=1):
            return np.asarray(self.model_.predict_proba(features), np.float64)

    def _features(self, X: Sequence[Recording]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        tables = _tables(X, hands=self.hands, cleaning=self.cleaning)
        usable = _with_hand(tables, answer=self.without_hand)
        if not tables:
            return usable, np.empty((0, len(feature_names())))
        features = np.array([_remembered_features(table, self.most_counted) for table in tables])
        if not self.vertical:
            features[:, -1] = np.nan
        return usable, features

    def _checked(
        self, X: Sequence[Recording], y: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[np.bool_], NDArray[np.float64]]:
        known = _as_classes(y, X)
        usable, features = self._features(X)
        if len(np.unique(known[usable])) < 2:
            raise ValueError(
                f"y: expected at least two classes of recordings with a hand, got {np.unique(known[usable])}"
            )
        return known, usable, features


class RoleTableNeighbour(ClassifierMixin, BaseEstimator):
    """Recognise manipulations as what the most similar known role table shows; nothing is fitted.

    Of equally near ones the class that has most of them is taken, then the first.

    Parameters
    ----------
    cleaning, hands, without_hand
        As in :class:`RoleTableClassifier`.
    compressed : {"changes", "relations"}, optional
        As in :func:`~sec_lab.role_tables.role_similarity`.

    Attributes
    ----------
    classes_ : (n_classes,) ndarray
    tables_ : list of RoleTable
        What is known.

    Examples
    --------
    >>> put = EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [0, 0, 0, 2, 2]], [(7, 1), (7, 2), (2, 1)])
    >>> take = EventChain([[9, 0, 2, 2, 9], [9, 0, 0, 0, 9], [2, 2, 2, 0, 0]], [(7, 1), (7, 2), (2, 1)])
    >>> RoleTableNeighbour().fit([put, take], ["put", "take"]).predict([take]).tolist()
    ['take']
    """

    def __init__(
        self,
        *,
        cleaning: Cleaning = _DEFAULT,
        hands: Sequence[int | str] | None = None,
        compressed: Compressed = "changes",
        without_hand: object = None,
    ) -> None:
        self.cleaning = cleaning
        self.hands = hands
        self.compressed = compressed
        self.without_hand = without_hand

    def fit(self, X: Sequence[Recording], y: ArrayLike) -> Self:
        """Remember the recordings (or their role tables) X and what they show, y, of shape (n,)."""
        known = _as_classes(y, X)
        tables = _tables(X, hands=self.hands, cleaning=self.cleaning)
        usable = _with_hand(tables, answer=self.without_hand)
        if not usable.any():
            raise ValueError("X: expected at least one recording with a hand, got none")
        self.tables_ = [table for table, good in zip(tables, usable, strict=True) if good]
        self.known_ = known[usable]
        self.classes_ = np.unique(self.known_)
        return self

    def predict(self, X: Sequence[Recording]) -> NDArray[Any]:
        """What each of the recordings shows, shape (n,)."""
        check_is_fitted(self)
        tables = _tables(X, hands=self.hands, cleaning=self.cleaning)
        usable = _with_hand(tables, answer=self.without_hand)
        found = [
            self._nearest(table) if good else self.without_hand for table, good in zip(tables, usable, strict=True)
        ]
        return _in_one_array(found, self.classes_.dtype, None if usable.all() else self.without_hand)

    def _nearest(self, table: RoleTable) -> Any:
        similar = np.array([role_similarity(table, other, compressed=self.compressed) for other in self.tables_])
        nearest = np.flatnonzero(similar >= similar.max() - 1e-9)
        counts = {one: int((self.known_[nearest] == one).sum()) for one in dict.fromkeys(self.known_[nearest].tolist())}
        return max(counts, key=lambda one: counts[one])


def _in_one_array(answers: list[Any], classes: np.dtype[Any], without_hand: object) -> NDArray[Any]:
    """Answers as they are: of the type of the classes, unless the answer without a hand is of another kind."""
    if not answers or without_hand is None:
        return np.array(answers, dtype=classes)
    if np.asarray(without_hand).dtype.kind != classes.kind:
        mixed: NDArray[Any] = np.empty(len(answers), dtype=object)
        mixed[:] = answers
        return mixed
    return np.array(answers)


def _tables(X: Sequence[Recording], *, hands: Sequence[int | str] | None, cleaning: Cleaning) -> list[RoleTable]:
    _check_several(X)
    return [role_table(one, hands=hands, cleaning=cleaning) for one in X]


def _check_several(X: Sequence[Recording]) -> None:
    if isinstance(X, RoleTable | Observation | EventChain):
        raise ValueError(f"X: expected a sequence of recordings, got a single {type(X).__name__}")


def _as_classes(y: ArrayLike, X: Sequence[Recording]) -> NDArray[Any]:
    _check_several(X)
    known = np.asarray(y)
    if known.ndim != 1 or len(known) != len(X):
        raise ValueError(f"y: expected one class for each of {len(X)} recordings, got shape {known.shape}")
    return known


def _with_hand(tables: Sequence[RoleTable], *, answer: object) -> NDArray[np.bool_]:
    usable = np.array(["hand" not in table.missing for table in tables], dtype=np.bool_)
    if answer is None and not usable.all():
        i = int(np.argmin(usable))
        raise ValueError(f"X: expected a hand in every recording, got none in number {i}: {tables[i].missing['hand']}")
    return usable
