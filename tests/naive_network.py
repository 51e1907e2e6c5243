"""Slow, obvious reference of the network of §3.2: matrices, one sample at a time, gradients by the chain rule."""

import numpy as np
from numpy.typing import NDArray

Weights = list[NDArray[np.float64]]


def naive_outputs(inputs: NDArray[np.float64], weights: Weights) -> NDArray[np.float64]:
    values = inputs
    for layer in weights:
        values = 1 / (1 + np.exp(-(np.append(values, np.ones((len(values), 1)), axis=1) @ layer)))
    return values


def naive_loss(inputs: NDArray[np.float64], wanted: NDArray[np.float64], weights: Weights) -> float:
    """Half the squared error, mean over samples."""
    return float(((naive_outputs(inputs, weights) - wanted) ** 2).sum(axis=1).mean() / 2)


def naive_step(
    inputs: NDArray[np.float64], wanted: NDArray[np.float64], weights: Weights, *, rate: float, step: float = 1e-6
) -> Weights:
    """One step along the gradient, which is measured by differences."""
    stepped = [layer.copy() for layer in weights]
    for number, layer in enumerate(weights):
        for place in np.ndindex(layer.shape):
            change = np.zeros_like(layer)
            change[place] = step
            up, down = ([*weights[:number], layer + sign * change, *weights[number + 1 :]] for sign in (1, -1))
            slope = (naive_loss(inputs, wanted, up) - naive_loss(inputs, wanted, down)) / (2 * step)
            stepped[number][place] -= rate * slope
    return stepped
