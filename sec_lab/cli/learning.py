"""Commands that learn models and find them again: ``sec-lab learn`` and ``sec-lab find``."""

import argparse
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from sec_lab.cli.chains import add_similarity_options, short_names
from sec_lab.cli.speaking import Commands, add_command, say
from sec_lab.files import UnusableFileError

if TYPE_CHECKING:
    from sec_lab.action_model import ActionModel
    from sec_lab.event_chain import EventChain
    from sec_lab.finding import OnlineFinder
    from sec_lab.observation import Observation
    from sec_lab.pipeline import LabelledFrame
    from sec_lab.recording import Recording
    from sec_lab.relations import SegmentRelations


def add_learning_commands(commands: Commands) -> None:
    """Add ``learn`` and ``find`` to the command line."""
    learn = add_command(
        commands,
        "learn",
        "the model that demonstrations of one manipulation have in common",
        "sec-lab learn putting_*.graphml -o putting.graphml",
        description="Learn the model that demonstrations of one manipulation have in common, and show it.",
    )
    learn.add_argument("chains", type=Path, nargs="+", metavar="CHAIN", help="GraphML file or SEC.dat table")
    learn.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="GraphML file of the model")
    learn.add_argument(
        "--mode",
        choices=("batch", "online"),
        default="batch",
        help="most typical first, or as they come",
    )
    learn.add_argument(
        "--threshold",
        type=float,
        default=0.51,
        metavar="WEIGHT",
        help="least weight of rows and columns (default: 0.51, more than half of the demonstrations)",
    )
    add_similarity_options(learn)
    learn.set_defaults(run=_learn)

    find = add_command(
        commands,
        "find",
        "where in a movie each model's action begins and ends",
        "sec-lab find putting.graphml taking.graphml movie.mp4 --right right.mp4 --calibration calibration.json",
        description="Find where in a movie the action of each model begins and ends.",
    )
    find.add_argument("models", type=Path, nargs="+", metavar="MODEL", help="GraphML files that sec-lab learn wrote")
    find.add_argument("movie", type=Path, metavar="MOVIE", help="movie, folder of frames, or chain (GraphML or table)")
    find.add_argument("--right", type=Path, metavar="MOVIE", help="movie of the right eye")
    find.add_argument(
        "--side-by-side", action="store_true", help="left and right half of each picture are a stereo pair"
    )
    find.add_argument("--depth", type=Path, metavar="FOLDER", help="folder of depth images")
    find.add_argument("--calibration", type=Path, metavar="FILE", help="calibration of the cameras")
    find.add_argument(
        "--least",
        type=float,
        default=80.0,
        metavar="PERCENT",
        help="least similarity that is reported (default: 80)",
    )
    find.add_argument("--online", action="store_true", help="report frame by frame, also what has only begun")
    find.set_defaults(run=_find)


def _learn(options: argparse.Namespace) -> int:
    from sec_lab.graphml import write
    from sec_lab.learning import learn

    names = short_names(options.chains)
    demonstrations = {name: _read(path) for name, path in zip(names, options.chains, strict=True)}
    model = learn(
        demonstrations,
        mode=options.mode,
        weight_threshold=options.threshold,
        normalizer=options.normalizer,
        tolerance_percent=options.tolerance,
    )
    write(options.output, model)
    for line in model_lines(model):
        say(line)
    passed_over = [name for name in names if name not in model.demonstrations]
    if passed_over:
        say(f"not type-similar: {', '.join(passed_over)}")
    return 0


def model_lines(model: "ActionModel") -> list[str]:
    """What is printed of a model: its rows with ω^r, and ω^c below."""
    chain = model.chain
    labels = [chain.row_label(row) for row in range(len(chain.pairs))]
    wide = max(len(label) for label in [*labels, "weight"])
    size = f"{len(labels)} rows, {len(chain.key_frames)} columns"
    lines = [f"model of {len(model.demonstrations)} demonstrations: {size}", ""]
    for label, row, weight in zip(labels, chain.relations.tolist(), model.row_weights.tolist(), strict=True):
        lines.append(f"{label:<{wide}}  {' '.join(f'{code:>4}' for code in row)}  {weight:.2f}")
    lines.append(f"{'weight':<{wide}}  {' '.join(f'{weight:.2f}' for weight in model.column_weights.tolist())}")
    return lines


def _find(options: argparse.Namespace) -> int:
    from sec_lab.finding import OnlineFinder, find_actions
    from sec_lab.graphml import read_model

    models = {name: read_model(path) for name, path in zip(short_names(options.models), options.models, strict=True)}
    if options.online:
        return _find_online(options, OnlineFinder(models, least_percent=options.least))
    found_actions = find_actions(models, _seen(options), least_percent=options.least)
    wide = max(len(name) for name in models)
    for found in found_actions:
        end = "the end" if found.end is None else f"{found.end:>6}"
        say(f"{found.model:<{wide}}  from frame {found.begin:>6} to {end}  ({found.similarity_percent:.0f} %)")
    if not found_actions:
        say("nothing found")
    return 0


def _find_online(options: argparse.Namespace, finder: "OnlineFinder") -> int:
    """Tell what is found as soon as the frame has been seen in which it begins or ends."""
    from sec_lab.observation import Observation
    from sec_lab.relations.over_time import steady_relations
    from sec_lab.scene_graph import SceneGraph, scene_graph

    def tell(frame: int, graph: SceneGraph) -> None:
        for found in finder.add(frame, graph):
            what = "may have begun" if found.end is None else f"ends, began in frame {found.begin}"
            say(f"frame {frame:>6}  {found.model} {what}  ({found.similarity_percent:.0f} %)")
            sys.stdout.flush()

    def told(frames: Iterable["LabelledFrame"]) -> Iterator[tuple[int, "SegmentRelations"]]:
        for number, relations in steady_relations(frames):
            tell(number, scene_graph(relations))
            yield number, relations

    if _is_chain(options.movie):
        movie = _seen(options)
        if not isinstance(movie, Observation):
            raise ValueError(f"{options.movie}: expected a movie or an observation for --online, got a table")
        for graph, frame in zip(movie.recorded, movie.recorded.key_frames.tolist(), strict=True):
            tell(frame, graph)
    else:
        from sec_lab.pipeline import observe

        observe(_recording(options), over_time=told, progress=sys.stderr.isatty())
    return 0


def _is_chain(path: Path) -> bool:
    return path.suffix.lower() in (".graphml", ".xml", ".dat")


def _seen(options: argparse.Namespace) -> "EventChain | Observation":
    if _is_chain(options.movie):
        if any((options.right, options.side_by_side, options.depth, options.calibration)):
            raise ValueError(
                f"{options.movie}: expected neither --right, --side-by-side, --depth nor --calibration beside a chain"
            )
        return _read(options.movie)
    from sec_lab.pipeline import observe

    return observe(_recording(options), progress=sys.stderr.isatty())


def _recording(options: argparse.Namespace) -> "Recording":
    from sec_lab.recording import Recording

    return Recording.open(
        options.movie,
        right=options.right,
        depth=options.depth,
        calibration=options.calibration,
        stereo="side by side" if options.side_by_side else "none",
    )


def _read(path: Path) -> "EventChain | Observation":
    """What a file holds: an observation, or the chain of a table."""
    from sec_lab.action_model import ActionModel
    from sec_lab.graphml import read, read_chain

    if path.suffix.lower() == ".dat":
        return read_chain(path)
    try:
        seen = read(path)
    except UnusableFileError as error:
        try:
            return read_chain(path)
        except UnusableFileError:
            raise error from None
    return seen.chain if isinstance(seen, ActionModel) else seen
