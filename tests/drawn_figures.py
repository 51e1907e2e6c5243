"""What is drawn, read back from figures; and chains to draw."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from numpy.typing import NDArray

from sec_lab.event_chain import EventChain
from sec_lab.viz.style import png_bytes

LABELS = np.ones((40, 60), dtype=np.uint8)
LABELS[5:20, 5:25], LABELS[20:35, 10:20], LABELS[10:25, 40:55] = 2, 4, 3

FRAME = np.full((40, 60, 3), 200, dtype=np.uint8)

CHAIN = EventChain(
    [[1, 2, 1, 1], [0, 0, 0, 0], [9, 0, 2, 9]], [(2, 1), (3, 1), (3, 2)], [0, 27, 37, 54], {2: "cup", 3: "US$ and CA$"}
)


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


def row_names(ax: Axes) -> list[str]:
    return [label.get_text() for label in ax.get_yticklabels()]


def column_names(ax: Axes) -> list[str]:
    return [label.get_text() for label in ax.get_xticklabels()]


def legend_of(ax: Axes | Figure) -> list[str]:
    legend = ax.get_legend() if isinstance(ax, Axes) else ax.legends[0]
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def rendered(drawn: Axes | Figure) -> NDArray[np.uint8]:
    """Pixels of the figure, so that everything in it is really drawn."""
    from io import BytesIO

    figure = drawn if isinstance(drawn, Figure) else drawn.get_figure(root=True)
    assert figure is not None
    return (imread(BytesIO(png_bytes(figure)))[:, :, :3] * 255).astype(np.uint8)


def random_chain(rng: np.random.Generator, n_rows: int, n_columns: int) -> EventChain:
    relations = rng.choice([0, 0, 1, 2, 9], size=(n_rows, n_columns))
    relations[0, :2] = 0, 2
    return EventChain(relations, [(100 + row, 1) for row in range(n_rows)])
