"""Compiled training of the small network of §3.2, for :mod:`sec_lab.baselines`; its twin is in the tests."""

import numpy as np

from sec_lab._chain_kernels import Integers, Numbers, compiled


@compiled
def forward(inputs: Numbers, weights: Numbers, units: Numbers) -> None:
    """Logistic units of one layer; the last row of the weights is the bias."""
    n = len(inputs)
    for j in range(len(units)):
        total = weights[n, j]
        for i in range(n):
            total += inputs[i] * weights[i, j]
        units[j] = 1.0 / (1.0 + np.exp(-total))


@compiled
def back(weights: Numbers, errors: Numbers, units: Numbers, out: Numbers) -> None:
    """Errors of a layer out of those of the next one."""
    for i in range(len(units)):
        total = 0.0
        for j in range(len(errors)):
            total += weights[i, j] * errors[j]
        out[i] = total * units[i] * (1.0 - units[i])


@compiled
def descend(weights: Numbers, units: Numbers, errors: Numbers, rate: float) -> None:
    """One step along the gradient."""
    n = len(units)
    for j in range(len(errors)):
        step = rate * errors[j]
        for i in range(n):
            weights[i, j] -= step * units[i]
        weights[n, j] -= step


@compiled
def train(
    inputs: Numbers,
    wanted: Numbers,
    orders: Integers,
    rate: float,
    by_epoch: bool,  # noqa: FBT001 - compiled functions take no keywords fast
    first: Numbers,
    second: Numbers,
    third: Numbers,
) -> Numbers:
    """Change the weights of three layers by plain gradient steps on half the squared error; returns the mean errors."""
    epochs, n = orders.shape
    a, b, c = np.empty(first.shape[1]), np.empty(second.shape[1]), np.empty(third.shape[1])
    in_a, in_b, in_c = np.empty_like(a), np.empty_like(b), np.empty_like(c)
    step_1, step_2, step_3 = np.zeros_like(first), np.zeros_like(second), np.zeros_like(third)
    losses = np.zeros(epochs)
    for epoch in range(epochs):
        for sample in orders[epoch]:
            forward(inputs[sample], first, a)
            forward(a, second, b)
            forward(b, third, c)
            for j in range(len(c)):
                difference = c[j] - wanted[sample, j]
                losses[epoch] += difference * difference / (n * len(c))
                in_c[j] = difference * c[j] * (1.0 - c[j])
            back(third, in_c, b, in_b)
            back(second, in_b, a, in_a)
            if by_epoch:
                descend(step_1, inputs[sample], in_a, rate / n)
                descend(step_2, a, in_b, rate / n)
                descend(step_3, b, in_c, rate / n)
            else:
                descend(first, inputs[sample], in_a, rate)
                descend(second, a, in_b, rate)
                descend(third, b, in_c, rate)
        if by_epoch:
            first += step_1
            second += step_2
            third += step_3
            step_1[:] = 0.0
            step_2[:] = 0.0
            step_3[:] = 0.0
    return losses


@compiled
def outputs(inputs: Numbers, first: Numbers, second: Numbers, third: Numbers) -> Numbers:
    """Outputs of the network for every input."""
    a, b = np.empty(first.shape[1]), np.empty(second.shape[1])
    out = np.empty((len(inputs), third.shape[1]))
    for sample in range(len(inputs)):
        forward(inputs[sample], first, a)
        forward(a, second, b)
        forward(b, third, out[sample])
    return out
