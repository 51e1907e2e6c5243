"""Noise explorer: what a noise level does to a chain, and what is left of similarity and roles (§3.1)."""

from collections.abc import Mapping, Sequence
from typing import Any, get_args

import ipywidgets as widgets
import numpy as np
from numpy.typing import NDArray

from sec_lab.event_chain import EventChain
from sec_lab.noise import Mode, Noise, NoisySamples, as_count, as_level
from sec_lab.noise_seeds import LIFTING, SEEDS
from sec_lab.viz.exploring import NoiseCurves, chain_of, noise_curves, noise_example
from sec_lab.viz.svg.curves import curves_svg
from sec_lab.viz.svg.model import sample_svg
from sec_lab.viz.svg.paper import sentence
from sec_lab.viz.widgets.base import INSET, LABELS, TOGGLES, WIDE, Explorer, never_raises, row_of
from sec_lab.viz.widgets.drawing import Drawing

N_SAMPLES = (10, 30, 100, 300, 1000)
"""Numbers of samples that can be chosen."""

_NARROW = {"width": "260px"}


class NoiseExplorer(Explorer):
    """Controls of noise, a sample and the curves; made by :func:`noise_explorer`.

    Attributes
    ----------
    p, mode, seed, n_samples, random_seed, example : ipywidgets widgets
        The controls.
    said : ipywidgets.HTML
        What noise of this level leaves, in a sentence.
    curves, sample : Drawing
        Similarity and objects over all levels, and the sample that was chosen.
    """

    def __init__(
        self, seeds: Mapping[str, EventChain], *, p: float, mode: Mode, n_samples: int, random_seed: int
    ) -> None:
        super().__init__()
        # Say what is wrong with an option.
        Noise(mode=mode)
        as_level(p)
        as_count(n_samples, "n_samples")
        as_count(random_seed, "random_seed", least=0)
        self._seeds = {str(name): chain_of(seed, f"seed {name}") for name, seed in seeds.items()}
        if not self._seeds:
            raise ValueError("seeds: expected at least one, got none")
        counts = sorted({*N_SAMPLES, n_samples})
        self.p = widgets.FloatSlider(
            value=p, min=0, max=1, step=0.05, description="noise level p (probability)", style=LABELS,
            readout_format=".2f", layout=WIDE,
        )  # fmt: skip
        self.mode = widgets.ToggleButtons(
            options=list(get_args(Mode)), value=mode, description="mode", style=TOGGLES, layout=INSET
        )
        self.seed = widgets.Dropdown(options=list(self._seeds), description="seed chain", style=LABELS, layout=_NARROW)
        self.n_samples = widgets.Dropdown(
            options=counts, value=n_samples, description="samples a level (number)", style=LABELS, layout=_NARROW
        )
        self.random_seed = widgets.BoundedIntText(
            value=random_seed, min=0, max=10**6, description="random seed (number)", style=LABELS, layout=_NARROW
        )
        self.example = widgets.IntSlider(
            value=1, min=1, max=n_samples, description="sample (no.)", style=LABELS, layout=WIDE
        )
        self.said, self.curves, self.sample = widgets.HTML(), Drawing(), Drawing()
        self._found: NoiseCurves | None = None
        self._is_moving = False
        controls = row_of(self.seed, self.mode, self.n_samples, self.random_seed)
        beside = widgets.VBox([self.example, self.sample])
        self.show(self.p, controls, self.work_bar, self.said, row_of(self.curves, beside))
        self._worker = self.latest(self._show_curves)
        self._draw_anew()
        self.on_move([self.seed, self.mode, self.n_samples, self.random_seed], self._draw_anew)
        self.on_move([self.p], self._draw_level)
        self.on_move([self.example], self._draw_sample)

    def wait(self) -> None:
        """Wait until the curves are shown."""
        self._worker.wait()

    def scrubbed(self) -> tuple[widgets.Widget, Sequence[Any]]:
        """The noise level, and where it can stand on a page without a kernel."""
        return self.p, [step / 10 for step in range(11)]

    @property
    def samples(self) -> NoisySamples:
        """Noisy samples of the level where the control stands."""
        return self._samples

    def _draw_anew(self) -> None:
        self._is_moving = True
        self.example.value = min(self.example.value, self.n_samples.value)
        self.example.max = self.n_samples.value
        self._is_moving = False
        # The curve of another seed is not shown beside the sample of this one.
        self._found, self.curves.svg = None, ""
        self._draw_level()
        seed, noise = self._seeds[self.seed.value], Noise(mode=self.mode.value)
        n_samples, random_seed = self.n_samples.value, self.random_seed.value
        self._worker.ask(
            lambda _: noise_curves(seed, noise=noise, n_samples=n_samples, random_seed=random_seed)
        )  # fmt: skip

    def _show_curves(self, found: NoiseCurves) -> None:
        self._found = found
        self._draw_curves()

    def _draw_curves(self) -> None:
        if self._found is not None:
            self.curves.svg = curves_svg(
                self._found.mean, error=self._found.error, x_label="noise level p (probability)",
                y_label="mean and standard error in %", marker=self.p.value, y_top=100,
            )  # fmt: skip

    def _draw_level(self) -> None:
        self._samples, self._similarity, self._objects = self._sampled()
        self._draw_curves()
        self._draw_sample()

    def _sampled(self) -> tuple[NoisySamples, NDArray[np.float64], NDArray[np.float64]]:
        return noise_example(
            self._seeds[self.seed.value], self.p.value, noise=Noise(mode=self.mode.value),
            n_samples=self.n_samples.value, random_seed=self.random_seed.value,
        )  # fmt: skip

    def _draw_sample(self) -> None:
        if self._is_moving:
            return
        place = self.example.value - 1
        n = len(self._samples)
        self.said.value = sentence(
            f"p = {self.p.value:.2f}, mean of {n} samples: similarity ψ {self._similarity.mean():.0f} %, "
            f"objects matched {self._objects.mean():.0f} %; sample {place + 1}: {self._similarity[place]:.0f} % and "
            f"{self._objects[place]:.0f} %"
        )
        self.sample.svg = sample_svg(self._samples, place, title=f"sample {place + 1} of {n}")


@never_raises
def noise_explorer(
    seeds: Mapping[str, EventChain] | None = None,
    *,
    p: float = 0.2,
    mode: Mode = "flip and add",
    n_samples: int = 100,
    random_seed: int = 0,
) -> Explorer:
    """Turn noise up and down: a sample of a seed, and similarity and objects over all levels (§3.1, Fig. 3.1 to 3.5).

    Parameters
    ----------
    seeds : mapping of names to EventChain, optional
        Chains that can be chosen; those of :mod:`sec_lab.noise_seeds` if left out.
    p, mode, n_samples, random_seed : optional
        Where the controls begin; see :func:`~sec_lab.noise.noisy_samples`.

    Returns
    -------
    NoiseExplorer
        Or, if something is wrong with what was given, an explorer that says what.

    Examples
    --------
    >>> explorer = noise_explorer(n_samples=10)
    >>> explorer.p.value = 0.0
    >>> "similarity ψ 100 %" in explorer.said.value
    True
    """
    given = {"3×5 (Fig. 3.1)": LIFTING, **SEEDS} if seeds is None else seeds
    if not isinstance(given, Mapping):
        raise TypeError(f"seeds: expected a mapping of names to event chains, got {type(given).__name__}")
    return NoiseExplorer(given, p=p, mode=mode, n_samples=n_samples, random_seed=random_seed)
