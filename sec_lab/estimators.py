"""The workbench's methods with the interface of scikit-learn."""

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.metrics import pairwise_distances_argmin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data
from threadpoolctl import threadpool_limits

from sec_lab.xmeans import x_means


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
