"""Label images that are computed once and read again from a file."""

import struct
import zlib
from collections.abc import Iterator
from functools import partial
from typing import BinaryIO

import numpy as np

from sec_lab.segmentation.record import Labels, Segmentation

_HEAD = struct.Struct("<qI")


def spooled(segmentation: Segmentation, file: BinaryIO) -> Segmentation:
    """The same segmentation, whose label images are kept in a file when they come for the first time.

    Segmenting costs much more than reading: who needs the label images of a movie twice, segments it once. An iteration
    that is broken off keeps nothing; the next one begins anew.

    Parameters
    ----------
    segmentation : Segmentation
    file : binary file
        Open for writing and reading, empty; e.g. a ``tempfile.TemporaryFile()``. Label images are compressed in it, to
        about a hundredth of their size.

    Returns
    -------
    Segmentation
        To be iterated over by one reader at a time, as long as the file is open.

    Examples
    --------
    >>> from tempfile import TemporaryFile
    >>> with TemporaryFile() as file:
    ...     segmentation = spooled(Segmentation.from_labels([[[1, 2]]]), file)
    ...     [image.tolist() for _ in range(2) for image in segmentation]
    [[[1, 2]], [[1, 2]]]
    """
    return Segmentation(
        _Spool(segmentation, file),
        segmentation.size,
        segmentation.frames,
        segmentation.background,
        segmentation.names,
    )


class _Spool:
    def __init__(self, segmentation: Segmentation, file: BinaryIO) -> None:
        self._segmentation = segmentation
        self._file = file
        self._is_complete = False

    def __call__(self) -> Iterator[tuple[int, Labels]]:
        return self._read() if self._is_complete else self._write()

    def _write(self) -> Iterator[tuple[int, Labels]]:
        self._file.seek(0)
        self._file.truncate()
        for number, labels in self._segmentation.numbered():
            packed = zlib.compress(labels.tobytes(), level=1)
            self._file.write(_HEAD.pack(number, len(packed)))
            self._file.write(packed)
            yield number, labels
        self._is_complete = True

    def _read(self) -> Iterator[tuple[int, Labels]]:
        self._file.seek(0)
        for head in iter(partial(self._file.read, _HEAD.size), b""):
            number, length = _HEAD.unpack(head)
            values = np.frombuffer(zlib.decompress(self._file.read(length)), dtype=np.uint16)
            yield number, values.reshape(self._segmentation.size)
