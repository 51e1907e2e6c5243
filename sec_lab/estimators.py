"""The workbench's methods with the interface of scikit-learn.

Event chains have no fixed number of features: wherever scikit-learn expects a table X, our estimators take a sequence
of event chains or observations, or an array of them (dtype object), as :func:`as_sample` makes it.
"""

from collections.abc import Sequence
from typing import Any, Literal, Self, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin, ClusterMixin, TransformerMixin
from sklearn.metrics import pairwise_distances_argmin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data
from threadpoolctl import threadpool_limits

from sec_lab.action_model import ActionModel
from sec_lab.event_chain import EventChain
from sec_lab.learning import WEIGHT_THRESHOLD, learn
from sec_lab.observation import Observation
from sec_lab.similarity import EFFORT, Direction, Normalizer, TemporalInput, pairwise_similarity
from sec_lab.xmeans import x_means

Sample: TypeAlias = Sequence[EventChain | Observation] | NDArray[np.object_]
Method = Literal["models", "nearest"]


class XMeans(ClusterMixin, BaseEstimator):
    """X-means with the interface of scikit-learn; see :func:`~sec_lab.xmeans.x_means`.

    Parameters
    ----------
    k_min, k_max, n_dimensions : int, optional
        As in :func:`~sec_lab.xmeans.x_means`.
    random_state : int, numpy.random.RandomState or None, optional
        Where the random starts come from; an int gives the same result every time.

    Attributes
    ----------
    labels_ : (n,) int64
        Cluster of each point of :meth:`fit`, 0, 1, … in the order in which the clusters first appear.
    cluster_centers_ : (n_clusters_, m) float64
    n_clusters_ : int
    bic_ : float
        Bayesian information criterion, see :func:`~sec_lab.xmeans.bic`.
    n_features_in_ : int

    Examples
    --------
    >>> model = XMeans(random_state=0).fit([[0.0], [0.2], [0.1], [5.0], [5.1], [5.2]])
    >>> model.n_clusters_, model.labels_, model.predict([[4.0]])
    (2, array([0, 0, 0, 1, 1, 1]), array([1]))
    """

    def __init__(
        self,
        *,
        k_min: int = 1,
        k_max: int | None = None,
        n_dimensions: int | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> None:
        self.k_min = k_min
        self.k_max = k_max
        self.n_dimensions = n_dimensions
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: object = None) -> Self:  # noqa: ARG002 - the interface has it
        """Find the clusters of the points X, shape (n, m); y is ignored."""
        points = validate_data(self, X, dtype=np.float64)
        rng = np.random.default_rng(check_random_state(self.random_state).randint(2**31))
        found = x_means(points, rng=rng, k_min=self.k_min, k_max=self.k_max, n_dimensions=self.n_dimensions)
        # Copies, as users of this interface may write into what they get.
        self.labels_ = found.labels.copy()
        self.cluster_centers_ = found.centers.copy()
        self.n_clusters_ = len(found.centers)
        self.bic_ = found.bic
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """Cluster whose centre is nearest to each of the points X, shape (n, m)."""
        check_is_fitted(self)
        points = validate_data(self, X, dtype=np.float64, reset=False)
        with threadpool_limits(limits=1):
            return np.asarray(pairwise_distances_argmin(points, self.cluster_centers_), np.int64)


class EventChainClassifier(ClassifierMixin, BaseEstimator):
    """Recognise manipulations by learned models (step 7) or by their nearest neighbour (§2.7).

    Parameters
    ----------
    method : {"models", "nearest"}, optional
        One model is learned for each class, and the most similar model says the class; or the most similar
        demonstration does.
    weight_threshold : float, optional
        As in :func:`~sec_lab.learning.learn`; for models only.
    direction : {"mean", "smaller", "larger", "directed"}, optional
        How both directions of a similarity become one; "directed" is that from the model or demonstration (ξ¹).
    normalizer, tolerance_percent, temporal_input, effort
        As in :func:`~sec_lab.similarity.compare`; models are always learned from the original chain.

    Attributes
    ----------
    classes_ : (n_classes,) array
        The classes, sorted.
    models_ : list of ActionModel or None
        Model of each class; None for a class of a single demonstration, which stands for itself, and with "nearest".
    references_ : (n_references,) array of EventChain
        What chains are compared with: models, or all demonstrations.
    reference_classes_ : (n_references,) int64
        Index of the class of each reference.

    Examples
    --------
    >>> put, take = (EventChain([[0, 2, 0], row], [(1, 2), (2, 3)]) for row in ([0, 0, 2], [2, 0, 0]))
    >>> classifier = EventChainClassifier().fit([put, take, put, take], ["put", "take", "put", "take"])
    >>> classifier.predict([take, put]).tolist()
    ['take', 'put']
    """

    def __init__(
        self,
        *,
        method: Method = "models",
        weight_threshold: float = WEIGHT_THRESHOLD,
        direction: Direction = "mean",
        normalizer: Normalizer = "longer",
        tolerance_percent: float = 0.0,
        temporal_input: TemporalInput = "original",
        effort: int = EFFORT,
    ) -> None:
        self.method = method
        self.weight_threshold = weight_threshold
        self.direction = direction
        self.normalizer = normalizer
        self.tolerance_percent = tolerance_percent
        self.temporal_input = temporal_input
        self.effort = effort

    def fit(self, X: Sample, y: ArrayLike) -> Self:
        """Learn from demonstrations X, n of them, whose classes are y.

        Raises
        ------
        ValueError
            If there is none, their number is not that of the classes, an option is unknown, or a model cannot be
            learned; the class is named.
        """
        if self.method not in get_args(Method):
            raise ValueError(f"method: expected one of {get_args(Method)}, got {self.method!r}")
        _check_direction(self.direction)
        sample, types = as_sample(X), np.asarray(y)
        if types.shape != sample.shape:
            raise ValueError(f"y: expected a class for each of {len(sample)} chains, got shape {types.shape}")
        self.classes_, index = np.unique(types, return_inverse=True)
        if self.method == "nearest":
            self.models_: list[ActionModel | None] = [None] * len(self.classes_)
            self.references_, self.reference_classes_ = _chains(sample), index.astype(np.int64)
            return self
        self.models_ = [self._model(sample[index == number], name) for number, name in enumerate(self.classes_)]
        chains = [
            model.chain if model is not None else _chains(sample[index == number])[0]
            for number, model in enumerate(self.models_)
        ]
        self.references_, self.reference_classes_ = _as_objects(chains), np.arange(len(self.classes_))
        return self

    def decision_function(self, X: Sample) -> NDArray[np.float64]:
        """Similarity with the most similar reference of each class in percent, shape (n, n_classes)."""
        check_is_fitted(self)
        similarity = similarities(
            self.references_, as_sample(X), direction=self.direction, normalizer=self.normalizer,
            tolerance_percent=self.tolerance_percent, temporal_input=self.temporal_input, effort=self.effort,
        )  # fmt: skip
        best = np.full((similarity.shape[1], len(self.classes_)), -np.inf)
        for reference, number in zip(similarity, self.reference_classes_, strict=True):
            best[:, number] = np.maximum(best[:, number], reference)
        return best

    def predict(self, X: Sample) -> NDArray[Any]:
        """Class of each chain; of equally similar ones the first in ``classes_``."""
        # Percentages are quotients of whole numbers, so what differs less comes from rounding.
        return np.asarray(self.classes_[np.argmax(self.decision_function(X).round(9), axis=1)])

    def _model(self, members: NDArray[np.object_], name: object) -> ActionModel | None:
        if len(members) < 2:
            return None
        try:
            return learn(
                list(members), weight_threshold=self.weight_threshold, normalizer=self.normalizer,
                tolerance_percent=self.tolerance_percent, effort=self.effort,
            )  # fmt: skip
        except ValueError as error:
            raise ValueError(f"class {name}: {error}") from error


class SimilarityKernel(TransformerMixin, BaseEstimator):
    """Similarities with the demonstrations as a kernel for ``SVC(kernel="precomputed")``.

    ψ_temporal is no inner product: the matrix may have negative eigenvalues, with which a support vector machine is not
    a convex problem. They are counted, and can be cut off or turned round.

    Parameters
    ----------
    spectrum : {"keep", "clip", "flip"}, optional
        What is done about negative eigenvalues: nothing (default); set to 0; or made positive. Similarities of other
        chains are transformed by the same linear map.
    direction : {"mean", "smaller", "larger"}, optional
        A kernel has to be symmetric.
    normalizer, tolerance_percent, temporal_input, effort
        As in :func:`~sec_lab.similarity.compare`.

    Attributes
    ----------
    references_ : (n,) array of EventChain
    eigenvalues_ : (n,) float64
        Of the matrix of the demonstrations, ascending, before anything is done about them.
    n_negative_ : int
        Negative ones among them, beyond rounding.
    negative_share_ : float
        Share of their magnitude in the magnitude of all.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.svm import SVC
    >>> put, take = (EventChain([[0, 2, 0], row], [(1, 2), (2, 3)]) for row in ([0, 0, 2], [2, 0, 0]))
    >>> machine = make_pipeline(SimilarityKernel(), SVC(kernel="precomputed")).fit([put, take, put, take], [0, 1, 0, 1])
    >>> machine.predict([take, put]).tolist(), machine[0].n_negative_
    ([1, 0], 0)
    """

    def __init__(
        self,
        *,
        spectrum: Literal["keep", "clip", "flip"] = "keep",
        direction: Direction = "mean",
        normalizer: Normalizer = "longer",
        tolerance_percent: float = 0.0,
        temporal_input: TemporalInput = "original",
        effort: int = EFFORT,
    ) -> None:
        self.spectrum = spectrum
        self.direction = direction
        self.normalizer = normalizer
        self.tolerance_percent = tolerance_percent
        self.temporal_input = temporal_input
        self.effort = effort

    def fit(self, X: Sample, y: object = None) -> Self:  # noqa: ARG002 - the interface has it
        """Keep the demonstrations X and look at the eigenvalues of their similarities; y is ignored.

        Raises
        ------
        ValueError
            If there is none, or an option is unknown.
        """
        if self.spectrum not in ("keep", "clip", "flip"):
            raise ValueError(f"spectrum: expected keep, clip or flip, got {self.spectrum!r}")
        _check_direction(self.direction)
        if self.direction == "directed":
            raise ValueError("direction: expected mean, smaller or larger for a kernel, got 'directed'")
        self.references_ = _chains(as_sample(X))
        with threadpool_limits(limits=1):
            values, vectors = np.linalg.eigh(self._similarities(self.references_))
        size = np.abs(values)
        negative = values < -1e-9 * size.max()
        self.eigenvalues_ = values
        self.n_negative_ = int(negative.sum())
        self.negative_share_ = float(size[negative].sum() / size.sum())
        sign = np.where(negative, 0.0 if self.spectrum == "clip" else -1.0, 1.0)
        self._map = None if self.spectrum == "keep" else (vectors * sign) @ vectors.T
        return self

    def transform(self, X: Sample) -> NDArray[np.float64]:
        """Similarities of chains X with the demonstrations, 0 to 1, shape (n_chains, n)."""
        check_is_fitted(self)
        kernel = self._similarities(as_sample(X))
        if self._map is None:
            return kernel
        with threadpool_limits(limits=1):
            return np.asarray(kernel @ self._map)

    def _similarities(self, sample: NDArray[np.object_]) -> NDArray[np.float64]:
        percent = similarities(
            self.references_, sample, direction=self.direction, normalizer=self.normalizer,
            tolerance_percent=self.tolerance_percent, temporal_input=self.temporal_input, effort=self.effort,
        )  # fmt: skip
        return percent.T / 100.0


def as_sample(chains: Sample) -> NDArray[np.object_]:
    """Event chains or observations as an array that scikit-learn can split.

    Raises
    ------
    TypeError
        If one is neither a chain nor an observation.
    ValueError
        If there is none.

    Examples
    --------
    >>> as_sample([EventChain([[0, 2]], [(1, 2)])]).shape
    (1,)
    """
    values = list(chains)
    if not values:
        raise ValueError("X: expected at least one event chain, got none")
    wrong = next((value for value in values if not isinstance(value, EventChain | Observation)), None)
    if wrong is not None:
        raise TypeError(f"X: expected event chains or observations, got {type(wrong).__name__}")
    return _as_objects(values)


def similarities(
    references: Sample,
    sample: Sample,
    *,
    direction: Direction = "mean",
    normalizer: Normalizer = "longer",
    tolerance_percent: float = 0.0,
    temporal_input: TemporalInput = "original",
    effort: int = EFFORT,
) -> NDArray[np.float64]:
    """ψ_temporal of every reference (ξ¹) with every chain of a sample in percent, shape (n_references, n).

    Parameters
    ----------
    references, sample : sequences of EventChain or Observation
    direction : {"mean", "smaller", "larger", "directed"}, optional
        Mean, smaller or larger of both directions, or that from the reference.
    normalizer, tolerance_percent, temporal_input, effort
        As in :func:`~sec_lab.similarity.compare`.

    Raises
    ------
    ValueError
        If the direction is unknown, or as in :func:`~sec_lab.similarity.compare`.
    """
    _check_direction(direction)
    seeds, others = _chains(as_sample(references)), _chains(as_sample(sample))
    n = len(seeds)
    table = pairwise_similarity(
        [*seeds, *others], normalizer=normalizer, tolerance_percent=tolerance_percent, temporal_input=temporal_input,
        effort=effort, measures=("temporal",), n_seeds=n,
    ).temporal  # fmt: skip
    forward, backward = table[:n, n:], table[n:, :n].T
    if direction == "directed":
        return forward
    if direction == "mean":
        return (forward + backward) / 2
    both: NDArray[np.float64] = (np.minimum if direction == "smaller" else np.maximum)(forward, backward)
    return both


def _chains(sample: NDArray[np.object_]) -> NDArray[np.object_]:
    return _as_objects([one.chain if isinstance(one, Observation) else one for one in sample])


def _as_objects(values: Sequence[object]) -> NDArray[np.object_]:
    array = np.empty(len(values), object)
    array[:] = values
    return array


def _check_direction(direction: str) -> None:
    if direction not in get_args(Direction):
        raise ValueError(f"direction: expected one of {get_args(Direction)}, got {direction!r}")
