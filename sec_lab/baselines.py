"""Opponents of classification by similarity (§3.2), with the interface of scikit-learn.

The thesis's network, and what a user would pick instead today: a string kernel with a support vector machine, and
gradient boosting on hand-made features. All take a sequence of event chains; the network and the boosted trees see
them as vectors.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.ensemble import GradientBoostingClassifier
from sklearn.feature_extraction.text import CountVectorizer
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, Normalizer
from sklearn.svm import SVC
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from sec_lab import _network_kernels as kernels
from sec_lab._noise_kernels import compare_with_samples
from sec_lab._packed_chains import CODE_OF_RELATION, check_comparable
from sec_lab.event_chain import EventChain
from sec_lab.similarity import EFFORT, check_options
from sec_lab.similarity import Normalizer as RowNormalizer

Chains = Sequence[EventChain]
Updates = Literal["sample", "epoch"]


def chain_vectors(chains: Chains, *, n_inputs: int = 36) -> NDArray[np.float64]:
    """Chains as vectors of one length, row after row (Fig. 3.8).

    Departure: relations 0, 1, 2 and 9 are divided by 9, so that logistic units do not begin saturated; the thesis does
    not say how its inputs are scaled. A chain that is too long is cut off, one that is too short filled up with
    absence: a vector has no other way to hold it, which is the thesis's point (§3.3).

    Parameters
    ----------
    chains : sequence of n EventChain
    n_inputs : int, optional
        36 for 6×6.

    Returns
    -------
    (n, n_inputs) float64
        From 0 to 1.

    Raises
    ------
    ValueError
        If there is no chain or no input.

    Examples
    --------
    >>> chain_vectors([EventChain([[0, 2], [9, 0]], [(1, 2), (2, 3)])], n_inputs=5).round(2)
    array([[0.  , 0.22, 1.  , 0.  , 1.  ]])
    """
    _check_chains(chains)
    if n_inputs < 1:
        raise ValueError(f"n_inputs: expected at least 1, got {n_inputs}")
    vectors = np.full((len(chains), n_inputs), 9, np.float64)
    for vector, chain in zip(vectors, chains, strict=True):
        flat = chain.relations.ravel()[:n_inputs]
        vector[: len(flat)] = flat
    return vectors / 9.0


def closest_code(outputs: ArrayLike) -> NDArray[np.int64]:
    """Class whose code (one 1, otherwise 0) is closest to each output in Euclidean distance (§3.2.2).

    Parameters
    ----------
    outputs : (n, n_classes) array_like of float
        Of a network, or similarities divided by 100.

    Returns
    -------
    (n,) int64
        The first of equally close ones.

    Raises
    ------
    ValueError
        If the shape is another or a number is not finite.

    Examples
    --------
    >>> closest_code([[0.1, 0.2, 0.8, 0.5]])
    array([2])
    """
    values = np.asarray(outputs, np.float64)
    if values.ndim != 2 or not values.shape[1] or not np.isfinite(values).all():
        raise ValueError(f"outputs: expected finite numbers of shape (n, n_classes), got shape {values.shape}")
    # ‖o − e_c‖² = ‖o‖² − 2 o_c + 1 is least where o_c is largest.
    return np.argmax(values, axis=1).astype(np.int64)


class ThesisNetwork(ClassifierMixin, BaseEstimator):
    """Feed-forward backpropagation network of §3.2: two hidden layers of five logistic units, one output a class.

    Squared error, plain gradient steps without momentum. All four outputs are logistic, which scikit-learn's
    ``MLPRegressor`` does not offer; so these few lines are our own, compiled.

    Parameters
    ----------
    n_inputs : int, optional
        As in :func:`chain_vectors`.
    n_hidden : tuple of int, optional
        Units of both hidden layers.
    learning_rate : float, optional
    epochs : int, optional
        How often every training sample is seen.
    updates : {"sample", "epoch"}, optional
        Change the weights after every sample (in a new random order every epoch), or once an epoch by the mean
        gradient. The thesis does not say which.
    random_state : int, numpy.random.RandomState or None, optional
        Initial weights, uniform within ± 0.5, and the order of the samples.

    Attributes
    ----------
    classes_ : (n_classes,)
    weights_ : list of float64 arrays
        (units + 1, units of the next layer); the last row is the bias.
    loss_curve_ : (epochs,) float64
        Mean squared error of the outputs during each epoch.

    Examples
    --------
    >>> seeds = [EventChain([[0, 2], [2, 0]], [(1, 2), (2, 3)]), EventChain([[2, 0], [0, 2]], [(1, 2), (2, 3)])]
    >>> network = ThesisNetwork(n_inputs=4, random_state=0).fit(seeds * 10, ["put", "take"] * 10)
    >>> network.predict(seeds).tolist()
    ['put', 'take']
    """

    def __init__(
        self,
        *,
        n_inputs: int = 36,
        n_hidden: tuple[int, int] = (5, 5),
        learning_rate: float = 0.5,
        epochs: int = 1000,
        updates: Updates = "sample",
        random_state: int | np.random.RandomState | None = None,
    ) -> None:
        self.n_inputs = n_inputs
        self.n_hidden = n_hidden
        self.learning_rate = learning_rate
        self.epochs = epochs
        self.updates = updates
        self.random_state = random_state

    def fit(self, X: Chains, y: ArrayLike) -> Self:
        """Train on chains and their classes.

        Parameters
        ----------
        X : sequence of n EventChain
        y : (n,) array_like
            Their classes, at least two.

        Raises
        ------
        TypeError
            If X is no sequence of event chains.
        ValueError
            If there are fewer than two classes or another number of them than of chains, or an option is out of range.
        """
        if self.updates not in get_args(Updates):
            raise ValueError(f"updates: expected one of {get_args(Updates)}, got {self.updates!r}")
        hidden = self.n_hidden
        if not isinstance(hidden, tuple | list) or len(hidden) != 2 or not all(_is_count(units) for units in hidden):
            raise ValueError(f"n_hidden: expected two whole numbers of at least 1, got {hidden!r}")
        if not _is_count(self.epochs):
            raise ValueError(f"epochs: expected a whole number of at least 1, got {self.epochs!r}")
        if not 0 < self.learning_rate < np.inf:
            raise ValueError(f"learning_rate: expected a finite number above 0, got {self.learning_rate!r}")
        inputs = chain_vectors(X, n_inputs=self.n_inputs)
        self.classes_, targets = _classes(y, len(X))
        rng = np.random.default_rng(check_random_state(self.random_state).randint(2**31))
        sizes = (self.n_inputs, *self.n_hidden, len(self.classes_))
        first, second, third = (rng.uniform(-0.5, 0.5, (before + 1, after)) for before, after in pairwise(sizes))
        orders = np.stack([rng.permutation(len(inputs)) for _ in range(self.epochs)])
        wanted = np.eye(len(self.classes_))[targets]
        self.loss_curve_ = kernels.train(
            inputs, wanted, orders, float(self.learning_rate), self.updates == "epoch", first, second, third
        )
        self.weights_ = [first, second, third]
        return self

    def decision_function(self, X: Chains) -> NDArray[np.float64]:
        """Outputs, (n, n_classes) from 0 to 1."""
        check_is_fitted(self)
        inputs = chain_vectors(X, n_inputs=self.n_inputs)
        outputs: NDArray[np.float64] = kernels.outputs(inputs, *self.weights_)
        return outputs

    def predict(self, X: Chains) -> NDArray[Any]:
        """Class whose code is closest to the outputs."""
        check_is_fitted(self)
        return np.asarray(self.classes_[closest_code(self.decision_function(X))])


class SimilarityClassifier(ClassifierMixin, BaseEstimator):
    """The thesis's own classifier: one learned model a class, and the similarity of a chain with each (§3.2.2).

    Parameters
    ----------
    normalizer, tolerance_percent : optional
        As in :func:`~sec_lab.similarity.compare`.
    weight_threshold : float, optional
        As in :func:`~sec_lab.learning.learn`.

    Attributes
    ----------
    classes_ : (n_classes,)
    models_ : list of ActionModel

    Examples
    --------
    >>> seeds = [EventChain([[0, 2], [2, 0]], [(1, 2), (2, 3)]), EventChain([[2, 9], [0, 9]], [(1, 2), (2, 3)])]
    >>> SimilarityClassifier().fit(seeds * 3, ["put", "take"] * 3).predict(seeds).tolist()
    ['put', 'take']
    """

    def __init__(
        self,
        *,
        normalizer: RowNormalizer = "longer",
        tolerance_percent: float = 0.0,
        weight_threshold: float = 0.5,
    ) -> None:
        self.normalizer = normalizer
        self.tolerance_percent = tolerance_percent
        self.weight_threshold = weight_threshold

    def fit(self, X: Chains, y: ArrayLike) -> Self:
        """Learn a model of each class."""
        from sec_lab.learning import learn

        _check_chains(X)
        self.classes_, targets = _classes(y, len(X))
        self.models_ = [
            learn(
                [chain for chain, target in zip(X, targets.tolist(), strict=True) if target == number],
                normalizer=self.normalizer, tolerance_percent=self.tolerance_percent,
                weight_threshold=self.weight_threshold, n_threads=1,
            )
            for number in range(len(self.classes_))
        ]  # fmt: skip
        return self

    def decision_function(self, X: Chains) -> NDArray[np.float64]:
        """Temporal similarity of the models (ξ¹) with each chain, (n, n_classes) from 0 to 1; 0 if nothing changes."""
        check_is_fitted(self)
        _check_chains(X)
        similar = [
            _similarities(model.chain, X, normalizer=self.normalizer, tolerance_percent=self.tolerance_percent)
            for model in self.models_
        ]
        return np.column_stack(similar) / 100.0

    def predict(self, X: Chains) -> NDArray[Any]:
        """Class whose code is closest to the similarities."""
        check_is_fitted(self)
        return np.asarray(self.classes_[closest_code(self.decision_function(X))])


def _similarities(
    model: EventChain, chains: Chains, *, normalizer: RowNormalizer, tolerance_percent: float
) -> NDArray[np.float64]:
    """Temporal similarity of a model with many chains, in percent, 0 where nothing changes."""
    check_comparable(model, "model")
    check_options(normalizer, tolerance_percent, "original", EFFORT)
    shapes = np.array([chain.relations.shape for chain in chains])
    n, (m, k) = len(chains), shapes.max(axis=0)
    codes = np.zeros((n, m, k), np.uint8)
    for room, chain in zip(codes, chains, strict=True):
        room[: chain.relations.shape[0], : chain.relations.shape[1]] = CODE_OF_RELATION[chain.relations]
    rows, columns = np.arange(m) < shapes[:, :1], np.arange(k) < shapes[:, 1:]
    seed = CODE_OF_RELATION[model.relations[model.changing_rows]]
    spatial, temporal, exact = np.empty(n), np.empty(n), np.empty(n, np.bool_)
    # Objects are of no interest here: all are one.
    nobody = np.zeros((n, m, 2), np.int64)
    compare_with_samples(
        seed, np.zeros((len(seed), 2), np.int64), 1, 1, codes, rows, columns, nobody, int(normalizer == "shorter"),
        float(tolerance_percent), EFFORT, spatial, temporal, exact, np.empty((n, 3), np.int64),
    )  # fmt: skip
    return temporal


def row_words(chain: EventChain, *, longest: int = 3) -> list[str]:
    """Words of up to so many relations that follow each other in a row of a chain, repeats of a relation left out.

    Examples
    --------
    >>> row_words(EventChain([[0, 2, 2, 9]], [(1, 2)]), longest=2)
    ['0', '2', '9', '02', '29']
    """
    words = []
    for row in chain.relations:
        text = "".join(map(str, row[np.append(True, row[1:] != row[:-1])].tolist()))
        words += [text[at : at + n] for n in range(1, longest + 1) for at in range(len(text) - n + 1)]
    return words


def string_kernel_machine(*, longest: int = 3, cost: float = 10.0) -> Pipeline:
    """Support vector machine with a string kernel on event chains, after the idea of Luo et al. (2011).

    The kernel of two chains is the sum, over all pairs of their rows, of the words of up to ``longest`` relations that
    both have (a blended spectrum kernel), normalised to 1 for a chain with itself. So neither the order of rows nor
    their number has to be fixed. It is a scalar product of word counts, which is how it is computed.

    Parameters
    ----------
    longest : int, optional
        Relations in a word.
    cost : float, optional
        C of the machine.

    Returns
    -------
    sklearn.pipeline.Pipeline
        For sequences of chains; ``decision_function`` has one column a class (and is flat for two, as ever there).
        What is no event chain is a TypeError.

    Raises
    ------
    ValueError
        If words are shorter than one relation, or the cost is not above 0.

    Examples
    --------
    >>> seeds = [EventChain([[0, 2, 0]], [(1, 2)]), EventChain([[9, 2, 9]], [(1, 2)])]
    >>> string_kernel_machine().fit(seeds * 3, ["put", "take"] * 3).predict(seeds).tolist()
    ['put', 'take']
    """
    if longest < 1:
        raise ValueError(f"longest: expected at least 1, got {longest}")
    if not cost > 0:
        raise ValueError(f"cost: expected a number above 0, got {cost}")
    words: Callable[[EventChain], list[str]] = _RowWords(longest)
    machine = SVC(kernel="linear", C=cost, decision_function_shape="ovr")
    counted = CountVectorizer(analyzer=words, lowercase=False)
    return make_pipeline(FunctionTransformer(_checked_chains), counted, Normalizer(), machine)


class _RowWords:
    """:func:`row_words` with its length, so that a fitted pipeline can be stored."""

    def __init__(self, longest: int) -> None:
        self.longest = longest

    def __call__(self, chain: EventChain) -> list[str]:
        return row_words(chain, longest=self.longest)


def chain_features(chains: Chains) -> NDArray[np.float64]:
    """Hand-made features that depend neither on the order of rows nor on the size of a chain.

    Parameters
    ----------
    chains : sequence of n EventChain

    Returns
    -------
    (n, 46) float64
        Numbers of rows, of columns and of rows that change; share of each relation in all entries, in the first and in
        the last column (4 each); changes of each kind a row (16, the diagonal empty); mean, least and most changes of a
        row; and, for each relation, the share of rows that have it anywhere, begin and end with it (12).

    Examples
    --------
    >>> chain_features([EventChain([[0, 2], [9, 9]], [(1, 2), (2, 3)])])[0, :7]
    array([2.  , 2.  , 1.  , 0.25, 0.  , 0.25, 0.5 ])
    """
    _check_chains(chains)
    features = []
    for chain in chains:
        codes = CODE_OF_RELATION[chain.relations].astype(np.int64)
        m, k = codes.shape
        is_code = codes[:, :, None] == np.arange(4)
        steps = 4 * codes[:, :-1] + codes[:, 1:]
        changing = codes[:, :-1] != codes[:, 1:]
        kinds = np.bincount(steps[changing], minlength=16) / m
        per_row = changing.sum(axis=1)
        ends = is_code[per_row > 0] if (per_row > 0).any() else is_code
        features.append(
            np.concatenate(
                [
                    [m, k, (per_row > 0).sum()],
                    is_code.mean(axis=(0, 1)), is_code[:, 0].mean(axis=0), is_code[:, -1].mean(axis=0),
                    kinds,
                    [per_row.mean(), per_row.min(), per_row.max()],
                    ends.any(axis=1).mean(axis=0), ends[:, 0].mean(axis=0), ends[:, -1].mean(axis=0),
                ]
            )
        )  # fmt: skip
    return np.array(features)


def boosted_trees(*, n_trees: int = 100, random_state: int | None = None) -> Pipeline:
    """Gradient boosting on :func:`chain_features`.

    Parameters
    ----------
    n_trees : int, optional
        Rounds of boosting, one tree a class each.
    random_state : int, optional

    Returns
    -------
    sklearn.pipeline.Pipeline
        For sequences of chains.

    Examples
    --------
    >>> seeds = [EventChain([[0, 2, 0]], [(1, 2)]), EventChain([[9, 2, 9]], [(1, 2)])]
    >>> boosted_trees(n_trees=5, random_state=0).fit(seeds * 9, ["put", "take"] * 9).predict(seeds).tolist()
    ['put', 'take']
    """
    trees = GradientBoostingClassifier(n_estimators=n_trees, max_depth=3, random_state=random_state)
    return make_pipeline(FunctionTransformer(chain_features), trees)


def _checked_chains(chains: Chains) -> Chains:
    _check_chains(chains)
    return chains


def _is_count(n: object) -> bool:
    return isinstance(n, int | np.integer) and not isinstance(n, bool) and bool(n >= 1)


def _check_chains(chains: Chains) -> None:
    if isinstance(chains, EventChain):
        raise TypeError("chains: expected a sequence of event chains, got a single one")
    if not len(chains):
        raise ValueError("chains: expected at least one event chain, got none")
    for chain in chains:
        if not isinstance(chain, EventChain):
            raise TypeError(f"chains: expected event chains, got {type(chain).__name__}")


def _classes(y: ArrayLike, n: int) -> tuple[NDArray[Any], NDArray[np.int64]]:
    known = np.asarray(y)
    if known.shape != (n,):
        raise ValueError(f"y: expected one class for each of {n} chains, got shape {known.shape}")
    classes, targets = np.unique(known, return_inverse=True)
    if len(classes) < 2:
        raise ValueError(f"y: expected at least two classes, got {classes.tolist()}")
    return classes, targets.astype(np.int64)
