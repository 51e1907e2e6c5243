"""The widget for a movie of one's own, without a browser."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sec_lab as sl
from sec_lab import Segmentation
from sec_lab.graphml import read_observation
from sec_lab.segmentation.masks import write_palette_pngs
from sec_lab.viz.widgets import own_movie
from sec_lab.viz.widgets.nearest import nearest, repository_chains
from sec_lab.viz.widgets.own_movie import save
from sec_lab.viz.widgets.upload import Upload


@pytest.fixture
def masks(tmp_path: Path) -> Path:
    labels = np.zeros((60, 30, 40), dtype=np.uint8)
    labels[:, 10:20, 25:35] = 2
    for number, image in enumerate(labels):
        left = min(number, 15)
        image[10:20, left : left + 10] = 1
    write_palette_pngs(tmp_path / "masks", Segmentation.from_labels(labels))
    return tmp_path / "masks"


def test_masks_alone_are_seen_compared_and_saved(masks: Path, tmp_path: Path) -> None:
    widget = own_movie(masks=masks, folder=tmp_path).wait()
    assert widget.explorer.alert == ""
    assert widget.explorer.book is not None
    widget.explorer.book.rename(1, "cup")
    widget.compare()
    widget.wait()
    assert "alert" not in widget._said.value
    assert widget.nearest is not None
    assert len(widget.nearest) == len(repository_chains())
    assert str(widget.nearest.index[0]) in widget._table.value
    widget._name.value = "mine"
    widget.save()
    assert [path.name for path in widget.saved] == ["mine.graphml", "mine.html"]
    assert read_observation(tmp_path / "mine.graphml").names[1] == "cup"
    assert "cup" in (tmp_path / "mine.html").read_text()
    widget._name.value = "../mine"
    widget.save()
    assert "without slashes" in widget._said.value


def test_a_chain_without_events_is_not_compared(tmp_path: Path) -> None:
    labels = np.ones((3, 20, 30), dtype=np.uint8)
    labels[:, 5:15, 5:15] = 2
    write_palette_pngs(tmp_path / "masks", Segmentation.from_labels(labels))
    widget = own_movie(masks=tmp_path / "masks").wait()
    widget.compare()
    widget.wait()
    assert "expected an event chain of at least two columns, got one." in widget._said.value


def test_a_known_movie_is_most_like_itself() -> None:
    chains = repository_chains()
    name = "making sandwich 3 kitchen (tabletop)"
    table = nearest(chains[name], chains)
    assert table.loc[name].tolist() == [100.0, 100.0, True]
    assert table.temporal.is_monotonic_decreasing
    match = sl.compare(chains[name], chains["sample 1 (drawn)"])
    assert table.loc["sample 1 (drawn)", "temporal"] == match.temporal
    with pytest.raises(ValueError, match="found no chain"):
        repository_chains(Path("no/such/folder"))


def test_what_cannot_be_saved_leaves_no_file(masks: Path, tmp_path: Path) -> None:
    seen = sl.observe(sl.Segmentation.from_labels(np.ones((2, 4, 4), dtype=np.uint8)))
    for name in ("", " ", ".x", "a/b"):
        with pytest.raises(ValueError, match="name: expected"):
            save(seen, None, folder=tmp_path, name=name)
    with pytest.raises(OSError, match="there is no folder"):
        save(seen, None, folder=tmp_path / "none", name="x")
    assert [path.name for path in tmp_path.iterdir()] == ["masks"]


def begin(size: int, turn: int = 1, name: str = "m.mp4") -> dict[str, Any]:
    return {"kind": "begin", "name": name, "size": size, "turn": turn}


def test_an_upload_arrives_whole_or_not_at_all() -> None:
    upload = Upload("a movie", most_mb=1)
    files: list[Path] = []
    problems: list[str] = []
    upload.on_file(files.append)
    upload.on_problem(problems.append)

    upload.hear(begin(6), [])
    upload.hear({"kind": "piece", "turn": 1}, [memoryview(b"abc")])
    assert upload.n_bytes == 3
    upload.hear({"kind": "end", "turn": 1}, [])
    assert problems == ["upload: expected 6 bytes, got 3; try again"]

    upload.hear(begin(2, turn=2), [])
    upload.hear({"kind": "piece", "turn": 2}, [b"abc"])
    assert problems[1:] == ["upload: expected 2 bytes, got more"]
    upload.hear({"kind": "too large", "size": 3e6, "turn": 3}, [])
    assert problems[2:] == ["upload: expected a file of at most 1 MB, got one of 3 MB; give its path"]
    # A page that says one size and sends another is not believed.
    upload.hear(begin(10**9, turn=4), [])
    upload.hear({"kind": "piece", "turn": 4}, [bytes(1_000_001)])
    assert len(problems) == 4

    # A new file breaks an old one off, whose late pieces are passed over.
    upload.hear(begin(4, turn=5, name="old.mp4"), [])
    upload.hear(begin(2, turn=6, name="new.mp4"), [])
    upload.hear({"kind": "piece", "turn": 5}, [b"zz"])
    upload.hear({"kind": "piece", "turn": 6}, [b"ab"])
    upload.hear({"kind": "end", "turn": 6}, [])
    assert [path.name for path in files] == ["new.mp4"]
    assert upload.path is not None
    folder = upload.path.parent
    assert [path.read_bytes() for path in folder.iterdir()] == [b"ab"]
    upload.close()
    assert not folder.exists()


@pytest.mark.parametrize(
    "name", ["../../etc/passwd", "..", "", "a/../../b.mp4", "C:\\x\\y.mp4", "ψ" * 400 + ".webm", "\0.mp4"]
)
def test_no_name_leads_out_of_the_folder(name: str) -> None:
    upload = Upload("a movie")
    upload.hear(begin(1, name=name), [])
    upload.hear({"kind": "piece", "turn": 1}, [b"x"])
    upload.hear({"kind": "end", "turn": 1}, [])
    assert upload.path is not None
    assert upload.path.parent == Path(upload._folder.name)
    assert upload.path.read_bytes() == b"x"
    upload.close()
