"""Plain Potts tracking: frames a second and covering, beside other segmenters on the same frames.

The movies are drawn: textured objects under uneven light, an arm that comes in, carries one of them past the others and
leaves, blur and sensor noise. Decoded frames are in memory; the time is that of segmentation, tracking, relations and
chain together.
"""

import time
from collections.abc import Callable
from functools import lru_cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.pipeline import observe_segments
from sec_lab.recording import Recording
from sec_lab.segmentation import TrackingParameters, superparamagnetic_clustering, track_segments

Labels = NDArray[np.integer]
Frames = NDArray[np.uint8]

COLOURS = np.array(
    [
        (70, 110, 75),
        (190, 60, 55),
        (60, 80, 180),
        (220, 190, 60),
        (150, 150, 155),
        (120, 60, 140),
        (230, 230, 225),
        (60, 160, 170),
        (40, 40, 45),
        (215, 150, 120),
    ]
)
ARM = len(COLOURS)


@lru_cache(maxsize=1)
def drawn_movie(width: int, height: int, n_frames: int, seed: int = 1) -> tuple[Labels, Frames]:
    """True labels and frames of a movie with eight objects on a ground (1) and an arm."""
    rng = np.random.default_rng(seed)
    unit = width / 320
    rows, columns = np.mgrid[:height, :width]
    texture = np.stack([cv2.GaussianBlur(rng.normal(size=(height, width)), (0, 0), 1.5 * unit) for _ in COLOURS])
    texture *= 6 / texture.std(axis=(1, 2), keepdims=True)
    light = (1 + 0.25 * (columns / width - 0.5) + 0.15 * (rows / height - 0.5))[..., None]
    places = rng.permutation([(x * width, y * height) for x in (0.16, 0.38, 0.62, 0.84) for y in (0.3, 0.72)])
    radii, aspects, angles = rng.uniform(13, 26, 8) * unit, rng.uniform(0.6, 1.1, 8), rng.uniform(0, np.pi, 8)
    outside, start, goal = np.array([1.15 * width, 1.1 * height]), places[0], places[3]
    labels, frames = np.empty((n_frames, height, width), np.uint8), np.empty((n_frames, height, width, 3), np.uint8)
    for i in range(n_frames):
        carried = _eased(i / n_frames, 0.35, 0.65) * (goal - start)
        grip = outside + _eased(i / n_frames, 0.05, 0.3) * (start - outside) + carried
        grip = grip + _eased(i / n_frames, 0.7, 0.95) * (outside - goal)
        picture = labels[i]
        picture[:] = 1
        for k in (*range(1, 8), 0):
            centre = places[k] + carried if k == 0 else places[k]
            along, across = _turned(columns - centre[0], rows - centre[1], angles[k])
            along, across = along / radii[k], across / (radii[k] * aspects[k])
            inside = along**2 + across**2 < 1 if k % 2 else np.maximum(abs(along), abs(across)) < 1
            picture[inside] = k + 2
        towards = outside - grip + np.array([0, 0.15 * height])
        along, across = _turned(columns - grip[0], rows - grip[1], np.arctan2(towards[1], towards[0]))
        palm = ((along - 6 * unit) / 14) ** 2 + (across / 13) ** 2 < unit**2
        picture[palm | ((along > 0) & (abs(across) < 9 * unit))] = ARM
        shown = (
            COLOURS[picture - 1] + np.take_along_axis(texture, picture[None].astype(np.int64) - 1, axis=0)[0, ..., None]
        )
        shown = cv2.GaussianBlur(shown * light, (0, 0), 0.6 * unit) + rng.normal(0, 3, shown.shape)
        frames[i] = np.clip(shown, 0, 255)
    return labels, frames


def _eased(share: float, first: float, last: float) -> float:
    time = min(max((share - first) / (last - first), 0), 1)
    return time * time * (3 - 2 * time)


def _turned(x: NDArray[np.float64], y: NDArray[np.float64], angle: float) -> tuple[NDArray[np.float64], ...]:
    return x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)


def scores(truth: Labels, found: Labels) -> dict[str, float]:
    """Area-weighted covering, mean IoU of objects, and share of frames in which objects keep a label of their own."""
    n = int(found.max()) + 1
    pairs = truth.astype(np.int64).reshape(len(truth), -1) * n + found.reshape(len(found), -1)
    shared = np.stack([np.bincount(row, minlength=(ARM + 1) * n) for row in pairs]).reshape(len(truth), ARM + 1, n)
    sizes = shared.sum(axis=2)
    union = sizes[:, :, None] + shared.sum(axis=1)[:, None] - shared
    best = (shared / np.maximum(union, 1)).max(axis=2)
    dominant, here = shared.sum(axis=0).argmax(axis=1), shared.argmax(axis=2)
    alone = np.bincount(dominant[1:], minlength=n)[dominant] == 1
    kept = ((here == dominant) & alone)[sizes > 0]
    objects = sizes[:, 2:] > 0
    return {
        "covering": float((best * sizes).sum() / sizes.sum()),
        "object IoU": float(best[:, 2:][objects].mean()),
        "kept": float(kept.mean()),
    }


def told(score: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in score.items())


@pytest.mark.parametrize(
    ("width", "height", "n_frames", "least"), [(320, 256, 100, 300), (640, 480, 60, 100), (1280, 720, 40, 40)]
)
@pytest.mark.parametrize("step", [None, 1])
def test_tracking(
    benchmark: BenchmarkFixture,
    capsys: pytest.CaptureFixture[str],
    width: int,
    height: int,
    n_frames: int,
    least: int,
    step: int | None,
) -> None:
    truth, frames = drawn_movie(width, height, n_frames)
    recording = Recording.from_frames(frames)
    parameters = TrackingParameters(lattice_step_px=step)
    benchmark.group = f"Potts tracking with relations and chain, {width}x{height}"
    found = np.stack(list(track_segments(recording, parameters=parameters)))
    seen = benchmark.pedantic(
        lambda: observe_segments(track_segments(recording, parameters=parameters)), rounds=5, warmup_rounds=1
    )
    assert seen.chain.relations.size
    score = scores(truth, found)
    # At full size the borders of the large picture are as wide as the lattice is blind to.
    assert score["covering"] > (0.98 if step is None else 0.9)
    if benchmark.stats is not None:
        per_second = n_frames / benchmark.stats.stats.min
        benchmark.extra_info["frames a second"] = round(per_second)
        lattice = "lattice of the picture's size" if step == 1 else "default lattice"
        with capsys.disabled():
            print(f"\n{width}x{height}, {lattice}: {per_second:.0f} frames/s (asked: {least}); {told(score)}")


def test_first_frame(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str]) -> None:
    _, frames = drawn_movie(320, 256, 100)
    benchmark.group = "first frame, 320x256"
    benchmark(superparamagnetic_clustering, frames[0], parameters=TrackingParameters().potts)
    if benchmark.stats is not None:
        with capsys.disabled():
            print(f"\nfirst frame, 320x256: {1000 * benchmark.stats.stats.median:.1f} ms (asked: at most 50)")


def felzenszwalb(frame: Frames) -> Labels:
    from skimage.segmentation import felzenszwalb as graph_based

    return np.asarray(graph_based(frame, scale=300, sigma=0.8, min_size=60)) + 1


def merged_superpixels(frame: Frames) -> Labels:
    from skimage.graph import cut_threshold, rag_mean_color
    from skimage.segmentation import slic

    superpixels = slic(frame, n_segments=400, compactness=10, start_label=1)
    return np.asarray(cut_threshold(superpixels, rag_mean_color(frame, superpixels), 25)) + 1


def linked(segment: Callable[[Frames], Labels], frames: Frames) -> Labels:
    """Segments of every frame; a segment takes the label of the one before that it covers best, or a new one."""
    images: list[Labels] = []
    n_labels = 0
    for frame in frames:
        image = segment(frame)
        count = int(image.max()) + 1
        label_of = np.zeros(count, np.int64)
        if images:
            before = images[-1].astype(np.int64)
            shared = np.bincount(image.ravel() * (n_labels + 1) + before.ravel(), minlength=count * (n_labels + 1))
            shared = shared.reshape(count, n_labels + 1)
            union = shared.sum(axis=1)[:, None] + shared.sum(axis=0) - shared
            overlap = shared / np.maximum(union, 1)
            taken = set()
            for k, label in zip(*np.unravel_index(np.argsort(-overlap, axis=None), overlap.shape), strict=True):
                if overlap[k, label] < 0.2:
                    break
                if not label_of[k] and label not in taken:
                    label_of[k] = label
                    taken.add(label)
        for k in np.unique(image):
            if not label_of[k]:
                n_labels += 1
                label_of[k] = n_labels
        images.append(label_of[image])
    return np.stack(images)


@pytest.mark.parametrize("other", [felzenszwalb, merged_superpixels])
def test_faster_than_other_segmenters(
    benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str], other: Callable[[Frames], Labels]
) -> None:
    truth, frames = (array[::5] for array in drawn_movie(320, 256, 100))
    benchmark.group = "other segmenters, 320x256"
    found = benchmark.pedantic(linked, (other, frames), rounds=1)
    if benchmark.stats is None:
        return
    # Every fifth frame is enough to time the others; they are linked over the same frames.
    per_frame = benchmark.stats.stats.min / len(frames)
    whole = drawn_movie(320, 256, 100)
    recording = Recording.from_frames(whole[1])
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        ours = np.stack(list(track_segments(recording)))
        seconds.append((time.perf_counter() - start) / len(ours))
    score, own = scores(truth, found), scores(truth, ours[::5])
    graph = "" if hasattr(cv2, "ximgproc") else " (cv2.ximgproc's GraphSegmentation is not in this build of OpenCV)"
    with capsys.disabled():
        print(f"\n{other.__name__}{graph}: {1000 * per_frame:.0f} ms a frame; {told(score)}")
        print(f"Potts tracking: {per_frame / min(seconds):.0f} times as fast; {told(own)}")
    assert own["covering"] >= score["covering"]
