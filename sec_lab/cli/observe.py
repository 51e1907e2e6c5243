"""``sec-lab observe``: from a movie, or from masks alone, to the event chain."""

import argparse
import csv
import io
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal

from sec_lab.cli.speaking import Commands, Parser, add_command, say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sec_lab.event_chain import EventChain, Names
    from sec_lab.observation import Observation
    from sec_lab.recording import Recording
    from sec_lab.segmentation import Segmentation

_FORMATS = {
    "palette-png": "palette PNG",
    "16-bit-png": "16-bit PNG",
    "mots-png": "MOTS PNG",
    "rgb-png": "RGB PNG",
    "object-png": "object PNG",
    "coco": "COCO",
    "youtube-vis": "YouTube-VIS",
    "sa-v": "SA-V",
    "mots": "MOTS",
    "numpy": "NumPy",
}
_OVERLAPS = {policy.replace(" ", "-"): policy for policy in ("error", "smaller on top", "first on top", "last on top")}
_NEED_MOVIE = ("right", "depth", "calibration", "side_by_side", "skip_corrupt")
_NEED_MASKS = ("mask_format", "background", "stride", "overlap", "video")
_USUAL_RATE = 25.0
_MOST_ROWS, _MOST_COLUMNS = 40, 24


def add_observe_command(commands: Commands) -> None:
    """Add ``observe`` to the command line."""
    observe = add_command(
        commands,
        "observe",
        "the event chain of a movie, or of the masks that a tracker found in it",
        "sec-lab observe movie.mp4 -o chain.graphml --overlay seen.mp4 --html seen.html\n"
        "  sec-lab observe movie.mp4 --masks masks/ --names 1=hand --names 2=cup\n"
        "  sec-lab observe left.mp4 --right right.mp4 --calibration camera.json --csv chain.csv",
    )
    observe.add_argument(
        "movie",
        type=Path,
        nargs="?",
        metavar="MOVIE|FOLDER",
        help="movie or folder of pictures; may be left out with --masks",
    )
    _add_recording_options(observe)
    _add_segment_options(observe)
    outputs = observe.add_argument_group("outputs", "written all together at the end, or none if anything goes wrong")
    outputs.add_argument("-o", "--output", type=Path, metavar="FILE", help="chain and scene graphs as GraphML (A.2)")
    outputs.add_argument("--csv", type=Path, metavar="FILE", help="chain as a table, a row a pair of segments")
    outputs.add_argument(
        "--overlay", type=Path, metavar="MOVIE", help="movie with segments, relations and chain drawn in"
    )
    outputs.add_argument("--html", type=Path, metavar="FILE", help="page with chain and key frames, for any browser")
    observe.set_defaults(run=_observe)


def _add_recording_options(observe: Parser) -> None:
    group = observe.add_argument_group("recording")
    group.add_argument("--right", type=Path, metavar="MOVIE|FOLDER", help="the right camera of a stereo pair")
    group.add_argument(
        "--side-by-side", action="store_true", help="left and right half of each picture are a stereo pair"
    )
    group.add_argument(
        "--depth", type=Path, metavar="FOLDER", help="depth pictures: 16-bit PNG in millimetres, or .npy in metres"
    )
    group.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help="camera (JSON): focal_length_px, principal_point_px, baseline_m",
    )
    group.add_argument("--fps", type=float, metavar="N", help="frames a second, instead of what the movie says")
    group.add_argument("--skip-corrupt", action="store_true", help="leave frames out that cannot be decoded, and go on")


def _add_segment_options(observe: Parser) -> None:
    group = observe.add_argument_group("segments and relations")
    group.add_argument(
        "--segmentation",
        choices=("layers", "potts"),
        help="layers: scene, changes and movers (default); potts: superparamagnetic clustering alone (§2.2)",
    )
    group.add_argument(
        "--over-time",
        choices=("steady", "none"),
        default="steady",
        help="steady: relations outlast flicker and occlusion (default); none: each frame by itself (A.1)",
    )
    group.add_argument(
        "--masks", type=Path, metavar="PATH", help="label masks of any tracker instead of a segmentation"
    )
    group.add_argument("--mask-format", choices=tuple(_FORMATS), help="told by the files if left out")
    group.add_argument("--background", metavar="ID", help="label of the background of masks, or none (default: 0)")
    group.add_argument("--stride", type=int, metavar="N", help="masks are those of every N-th frame")
    group.add_argument(
        "--overlap", choices=tuple(_OVERLAPS), help="whose pixel it is where masks overlap (default: error)"
    )
    group.add_argument("--video", metavar="NAME", help="id or name of the movie, where a file has masks of several")
    group.add_argument(
        "--names", action="append", default=[], metavar="ID=NAME|FILE",
        help="name of a segment, or a JSON file with names by id; may be given again",
    )  # fmt: skip


def _observe(options: argparse.Namespace) -> int:
    from sec_lab.files import written_together

    _check(options)
    wanted = [path for path in (options.output, options.csv, options.overlay, options.html) if path is not None]
    _check_places(options, wanted)
    with ExitStack() as stack:
        stack.enter_context(_terminated_as_interrupted())
        places = dict(zip(wanted, stack.enter_context(written_together(wanted)), strict=True))
        if options.overlay is not None:
            _check_movie(places[options.overlay], options.fps)
        recording = _open_recording(options)
        look_again = options.overlay is not None or options.html is not None
        spool = None
        if look_again and options.masks is None:
            # Beside the output, where there is room for large files; it has no name and leaves nothing.
            spool = stack.enter_context(tempfile.TemporaryFile(dir=wanted[0].parent))
        observation, n_frames = _observed(options, recording, spool)
        lines = _lines(observation, n_frames)
        _write(options, places, observation, recording)
    for line in lines:
        say(line)
    return 0


def _check(options: argparse.Namespace) -> None:
    if options.movie is None:
        if options.masks is None:
            raise ValueError("expected a movie or --masks, got neither")
        for name in _NEED_MOVIE:
            if getattr(options, name):
                raise ValueError(f"--{name.replace('_', '-')}: expected a movie beside it, got none")
    if options.masks is None:
        for name in _NEED_MASKS:
            if getattr(options, name) is not None:
                raise ValueError(f"--{name.replace('_', '-')}: expected --masks beside it, got none")
    elif options.segmentation is not None:
        raise ValueError("--segmentation: expected none beside --masks")
    if (options.right or options.side_by_side) and options.calibration is None:
        raise ValueError("--calibration: expected the camera of a stereo pair, which tells depth from disparity")


def _check_places(options: argparse.Namespace, wanted: list[Path]) -> None:
    """Refuse to write over what is read."""
    read = [options.movie, options.right, options.depth, options.calibration, options.masks]
    for path in wanted:
        if any(source is not None and path.resolve() == source.resolve() for source in read):
            raise ValueError(f"{path}: expected another place for the output than that of the input")


def _check_movie(place: Path, rate: float | None) -> None:
    """Find out now, not after an hour, whether such a movie can be written."""
    import numpy as np

    from sec_lab.recording import write_movie

    write_movie(place, [np.zeros((16, 16, 3), dtype=np.uint8)], frames_per_second=rate or _USUAL_RATE)
    place.unlink()


def _open_recording(options: argparse.Namespace) -> "Recording | None":
    if options.movie is None:
        return None
    from sec_lab.recording import Recording, read_calibration

    calibration = None if options.calibration is None else read_calibration(options.calibration)
    if (options.right or options.side_by_side) and calibration is not None and calibration.baseline_m is None:
        raise ValueError(f"{options.calibration}: expected baseline_m, the distance of the two cameras")
    return Recording.open(
        options.movie,
        right=options.right,
        depth=options.depth,
        calibration=calibration,
        stereo="side by side" if options.side_by_side else "none",
        frames_per_second=options.fps,
        on_corrupt="skip" if options.skip_corrupt else "error",
    )


def _observed(options: argparse.Namespace, recording: "Recording | None", spool: Any) -> tuple["Observation", int]:
    """What is seen, and in how many frames."""
    from sec_lab.pipeline import observe, segmenter
    from sec_lab.segmentation.spool import spooled

    typed, names = _read_names(options.names)
    counter = _Counter()
    over_time: Literal["steady"] | None = "steady" if options.over_time == "steady" else None
    progress = sys.stderr.isatty()
    if options.masks is not None:
        masks = counter.counted(_open_masks(options, names, None if recording is None else recording.size))
        source = masks if recording is None else recording
        observation = observe(source, segmentation=masks, over_time=over_time, progress=progress)
        _check_names(observation, typed)
        return observation, counter.n_frames
    assert recording is not None
    segment = segmenter(options.segmentation or "layers")

    def segmented(shared: "Recording") -> "Segmentation":
        found = counter.counted(segment(shared))
        return found if spool is None else spooled(found, spool)

    observation = observe(recording, segmentation=segmented, over_time=over_time, progress=progress)
    seen = {label: name for label, name in names.items() if label in observation.segments}
    observation = replace(observation, names={**observation.names, **seen})
    _check_names(observation, typed)
    return observation, counter.n_frames


def _open_masks(options: argparse.Namespace, names: "Names", size: tuple[int, int] | None) -> "Segmentation":
    from sec_lab.segmentation.masks import open_masks

    chosen: dict[str, Any] = {"names": names or None, "size": size, "stride": options.stride}
    if options.mask_format is not None:
        chosen["format"] = _FORMATS[options.mask_format]
    if options.background is not None:
        chosen["background"] = None if options.background == "none" else _as_id(options.background, what="--background")
    if options.overlap is not None:
        chosen["overlap"] = _OVERLAPS[options.overlap]
    if options.video is not None:
        chosen["video"] = int(options.video) if options.video.isdecimal() else options.video
    return open_masks(options.masks, **chosen)


class _Counter:
    """Counts the label images that come in one iteration."""

    def __init__(self) -> None:
        self.n_frames = 0

    def counted(self, segmentation: "Segmentation") -> "Segmentation":
        from sec_lab.segmentation import Segmentation

        read = partial(self._read, segmentation.numbered)
        return Segmentation(read, segmentation.size, segmentation.frames, segmentation.background, segmentation.names)

    def _read(
        self, numbered: "Callable[[], Iterator[tuple[int, NDArray[np.uint16]]]]"
    ) -> "Iterator[tuple[int, NDArray[np.uint16]]]":
        n_frames = 0
        for item in numbered():
            n_frames += 1
            yield item
        self.n_frames = n_frames


def _read_names(given: list[str]) -> tuple[dict[int, str | None], dict[int, str | None]]:
    """Names by id: those that were typed, and these with those of files."""
    from sec_lab.files import UnusableFileError
    from sec_lab.recording.json_files import read_json

    typed: dict[int, str | None] = {}
    names: dict[int, str | None] = {}
    for text in given:
        label, sign, name = text.partition("=")
        if sign and label.strip().isdecimal():
            typed[int(label)] = name
            continue
        told = read_json(text, expected="names of segments (ID=NAME, or a JSON file)")
        if not isinstance(told, dict) or not all(isinstance(name, str | None) for name in told.values()):
            raise UnusableFileError(f"{text}: expected an object with names by id")
        names |= {_as_id(label, what=text): name for label, name in told.items()}
    return typed, names | typed


def _as_id(text: str, *, what: str) -> int:
    if not text.isdecimal():
        raise ValueError(f"{what}: expected the id of a segment, got {text!r}")
    return int(text)


def _check_names(observation: "Observation", typed: "Names") -> None:
    """Refuse names that were typed for what was never seen; files may name more."""
    labels = observation.segments.tolist()
    told = {observation.names.get(label) for label in labels}
    for label, name in typed.items():
        if name not in told:
            seen = ", ".join(str(one) for one in labels[:10])
            raise ValueError(f"--names: expected ids of segments that were seen ({seen}), got {label}")


def _write(
    options: argparse.Namespace, places: dict[Path, Path], observation: "Observation", recording: "Recording | None"
) -> None:
    from sec_lab.files import write_whole

    if options.output is not None:
        from sec_lab.graphml import write

        write(places[options.output], observation)
    if options.csv is not None:
        write_whole(places[options.csv], _as_csv(observation.chain))
    if options.html is not None:
        from sec_lab.viz.page import observation_page

        title = (options.movie or options.masks).resolve().name
        write_whole(places[options.html], observation_page(observation, recording, title=title))
    if options.overlay is not None:
        _write_overlay(places[options.overlay], observation, recording, rate=options.fps)


def _write_overlay(
    place: Path, observation: "Observation", recording: "Recording | None", *, rate: float | None
) -> None:
    from tqdm import tqdm

    from sec_lab.recording import write_movie
    from sec_lab.viz.overlay import overlay_frames

    n_frames = None if observation.segmentation is None else observation.segmentation.n_frames
    if recording is not None:
        rate, n_frames = rate or recording.frames_per_second, recording.n_frames
    pictures = tqdm(
        overlay_frames(observation, recording),
        total=n_frames,
        unit="frame",
        desc="overlay",
        disable=not sys.stderr.isatty(),
    )
    write_movie(place, pictures, frames_per_second=rate or _USUAL_RATE, crf=20, preset="veryfast")


def _as_csv(chain: "EventChain") -> str:
    """A row a pair: its segments, their names, and the relation in each key frame."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["segment 1", "segment 2", "name 1", "name 2", *chain.key_frames.tolist()])
    for pair, row in zip(chain.pairs.tolist(), chain.relations.tolist(), strict=True):
        writer.writerow([*pair, *(chain.names.get(label) or "" for label in pair), *row])
    return stream.getvalue()


def _lines(observation: "Observation", n_frames: int) -> list[str]:
    """What is printed: how much was seen, and the rows of the chain in which something happens."""
    chain = observation.chain
    labels = observation.segments.tolist()
    told = [f"{label} {name}" if (name := observation.names.get(label)) else str(label) for label in labels]
    lines = [
        f"{n_frames} frames, {len(labels)} segments, {len(chain.key_frames)} key frames",
        f"segments: {', '.join(told[:_MOST_ROWS])}{', …' * (len(told) > _MOST_ROWS)}",
    ]
    rows = chain.changing_rows.tolist()
    if not rows:
        return [*lines, "nothing changes"]
    frames = [str(number) for number in chain.key_frames.tolist()[:_MOST_COLUMNS]]
    labels_of_rows = [chain.row_label(row) for row in rows[:_MOST_ROWS]]
    wide = max(len(text) for text in ["key frame", *labels_of_rows])
    lines += ["", f"{'key frame':<{wide}}  {' '.join(frames)}"]
    for label, row in zip(labels_of_rows, rows, strict=False):
        codes = chain.relations[row].tolist()[:_MOST_COLUMNS]
        cells = " ".join(f"{code:>{len(frame)}}" for code, frame in zip(codes, frames, strict=True))
        lines.append(f"{label:<{wide}}  {cells}")
    more = [
        f"{n} more {what}{'s' * (n > 1)}"
        for n, what in ((len(rows) - _MOST_ROWS, "row"), (len(chain.key_frames) - _MOST_COLUMNS, "key frame"))
        if n > 0
    ]
    n_still = len(chain.pairs) - len(rows)
    if n_still:
        more.append(f"{n_still} row{'s' * (n_still > 1)} in which nothing happens")
    return [*lines, f"(and {', '.join(more)})"] if more else lines


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Tidy up, too, when the run is asked to end from outside."""

    def interrupt(_: int, __: FrameType | None) -> None:
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not in the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
