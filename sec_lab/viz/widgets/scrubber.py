"""The chain explorer on a page without a kernel: pictures made beforehand, and a few lines of script that show them."""

import base64
import hashlib
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from sec_lab.viz.style import RELATION_WORD
from sec_lab.viz.tint import strong_colour
from sec_lab.viz.widgets.book import ChainBook
from sec_lab.viz.widgets.panels import webp_bytes

FOR_PAGES = "SEC_LAB_FOR_PAGES"
"""Environment variable that is set while the report executes notebooks."""
SCRUBBER = "application/vnd.sec-lab.scrubber+html"
"""Kind of output that the report shows instead of a live widget."""

MOST_BYTES = 3_500_000
"""A page with an explorer and its figures stays below 5 MB."""
_MOST_FRAMES, _MOST_WIDE = 150, 980
_QUALITIES = (80, 65, 50)


def scrubber_html(book: ChainBook, *, most_bytes: int = MOST_BYTES) -> str:
    """The explorer as HTML that scrubs, for a page that needs neither kernel nor network.

    Parameters
    ----------
    book : ChainBook
        Left where it is opened.
    most_bytes : int, optional
        Frames are left out evenly, key frames last, until the pictures fit.

    Returns
    -------
    str
        A piece of HTML, with its style and its script.

    Raises
    ------
    ValueError
        If not even two frames fit.

    Examples
    --------
    >>> from sec_lab.segmentation import Segmentation
    >>> from sec_lab.viz.widgets.seen import see
    >>> labels = np.ones((3, 20, 30), dtype=np.uint8)
    >>> labels[1:, 5:15, 5:15] = 2
    >>> page = scrubber_html(ChainBook(see(Segmentation.from_labels(labels))))
    >>> page.count("data:image/webp") > 3, "://" in page
    (True, False)
    """
    # Imported when it is used: a live explorer needs no templates.
    from jinja2 import Environment

    at = book.place, book.row, list(book.chosen)
    book.row = None
    book.choose([])
    places, pictures = _within(book, most_bytes)
    told, columns, outlines = [], [], []
    for place in places:
        book.go_to(place)
        told.append(book.told)
        columns.append(book.column)
        outlines.append(book.panels.outlines(book.frame))
    book.place, book.row = at[0], at[1]
    book.choose(at[2])
    recorded = book.observation.recorded
    first = [int(np.searchsorted(columns, column)) for column in range(len(recorded))]
    chain = book.chain
    rows = [] if chain is None else book.table.rows.tolist()
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(
        files("sec_lab.viz.widgets").joinpath("scrubber.html").read_text(encoding="utf-8")
    )
    n_frames, segments = len(book.numbers), book.observation.segments.tolist()
    return template.render(
        key=f"scrubber-{hashlib.sha256(''.join(pictures).encode()).hexdigest()[:12]}",
        pictures=pictures,
        size=book.panels.draw(book.frame, column=book.column).shape[1::-1],
        lefts=book.panels.lefts,
        key_frames=recorded.key_frames.tolist(),
        rows=[] if chain is None else [
            {"name": chain.row_label(row), "codes": chain.relations[row].tolist(), "pair": chain.pairs[row].tolist()}
            for row in rows
        ],
        words=[(int(relation), word) for relation, word in RELATION_WORD.items()],
        said="" if len(places) == n_frames else f"{len(places)} of {n_frames} frames are on this page.",
        data={
            "pictures": pictures, "told": told, "columns": columns, "first": first, "outlines": outlines,
            "colours": {label: "#{:02x}{:02x}{:02x}".format(*strong_colour(label)) for label in segments},
        },
    )  # fmt: skip


def _within(book: ChainBook, most_bytes: int) -> tuple[list[int], list[str]]:
    """Frames that fit, by index, and their pictures: less fine first, then fewer."""
    n = len(book.numbers)
    for n_wanted in (_MOST_FRAMES, _MOST_FRAMES // 2, _MOST_FRAMES // 4, 12, 2):
        places = _spread(n, n_wanted, [int(i) for i in np.searchsorted(book.numbers, book.observation.key_frames)])
        for quality in _QUALITIES:
            pictures = []
            n_bytes = 0
            for place in places:
                book.go_to(place)
                drawn = _narrow(book.panels.draw(book.frame, column=book.column))
                data = base64.b64encode(webp_bytes(drawn, quality=quality)).decode()
                pictures.append(f"data:image/webp;base64,{data}")
                n_bytes += len(pictures[-1])
                if n_bytes > most_bytes:
                    break
            else:
                return places, pictures
    raise ValueError(f"scrubber: expected two frames within {most_bytes} bytes, got larger ones")


def _spread(n: int, n_wanted: int, key_places: list[int]) -> list[int]:
    """Indices spread evenly over ``n``, with those of the key frames.

    Examples
    --------
    >>> _spread(10, 4, [4])
    [0, 3, 4, 6, 9]
    """
    if n <= n_wanted:
        return list(range(n))
    even = np.linspace(0, n - 1, n_wanted).round().astype(int).tolist()
    keys = [place for place in key_places if place < n] if len(key_places) <= n_wanted else []
    return sorted({*even, *keys})


def _narrow(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    import cv2

    scale = _MOST_WIDE / picture.shape[1]
    if scale >= 1:
        return picture
    size = (_MOST_WIDE, max(1, round(scale * picture.shape[0])))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
