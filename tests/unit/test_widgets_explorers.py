"""Explorers, driven by their controls: what they then say and show is what the library computes."""

import base64
import gc
import gzip
import html
import json
import re
import threading
from collections.abc import Callable
from xml.etree import ElementTree

import ipywidgets as widgets
import numpy as np
import pytest

import sec_lab as sl
from sec_lab.classification import threshold_errors
from sec_lab.event_chain import EventChain
from sec_lab.learning import learn
from sec_lab.noise import Noise, noisy_samples
from sec_lab.noise_seeds import CLASS_SEEDS, LIFTING, SEEDS
from sec_lab.noise_studies import noise_study
from sec_lab.report.pages import network_loads
from sec_lab.segmentation.potts import PottsParameters, superparamagnetic_clustering
from sec_lab.segmentation.quality import covering, quality
from sec_lab.segmentation.tracking import TrackingParameters, track_segments
from sec_lab.similarity import compare, permutations, similarity_table
from sec_lab.viz.frame_shelf import FrameShelf
from sec_lab.viz.widgets import (
    learning_explorer,
    match_explorer,
    noise_explorer,
    push_explorer,
    segmentation_explorer,
    table_explorer,
)
from sec_lab.viz.widgets.base import Explorer
from sec_lab.viz.widgets.scrubber import FOR_PAGES, SCRUBBER
from sec_lab.viz.widgets.still import shown_html, still_html
from sec_lab.worlds.katana import View

TYPES = ["putting", "pouring"]


def demonstrations(n: int = 4, p: float = 0.08) -> tuple[dict[str, EventChain], list[str]]:
    """Noisy demonstrations of two types, which one can tell apart."""
    rng = np.random.default_rng(7)
    seeds = {"putting": CLASS_SEEDS["moving"], "pouring": CLASS_SEEDS["pouring"]}
    chains, classes = {}, []
    for kind in TYPES:
        for number, chain in enumerate(noisy_samples(seeds[kind], p, n_samples=n, rng=rng, noise=Noise("flip only"))):
            chains[f"{kind} {number + 1}"] = chain
            classes.append(kind)
    return chains, classes


def data(markup: str, name: str) -> list[str]:
    return [one.attrib[name] for one in ElementTree.fromstring(markup).iter() if name in one.attrib]


def test_match_explorer_shows_the_comparison_of_its_controls() -> None:
    chains, _ = demonstrations()
    one, other = chains["putting 1"], chains["putting 2"]
    explorer = match_explorer(one, other, titles=("first", "second"))
    for normalizer, tolerance, temporal_input in (("longer", 0, "original"), ("shorter", 30, "derived")):
        explorer.normalizer.value = normalizer
        explorer.tolerance.value = tolerance
        explorer.temporal_input.value = temporal_input
        expected = compare(
            one, other, normalizer=normalizer, tolerance_percent=tolerance, temporal_input=temporal_input
        )  # fmt: skip
        assert explorer.match.temporal == expected.temporal
        assert f"ψ_spatial {expected.spatial:.0f} %, ψ_temporal {expected.temporal:.0f} %" in explorer.said.value
        assert data(explorer.chains.svg, "data-row") == [f"{a}-{b}" for a, b in expected.rows.tolist()]
        assert len(data(explorer.rows.svg, "data-candidate")) == expected.candidates.sum()
    assert "first" in explorer.chains.svg
    explorer.names.value = "names"
    assert "bowl, apple" in "".join(ElementTree.fromstring(explorer.chains.svg).itertext())


def test_match_explorer_shows_every_permutation() -> None:
    twice = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)])
    explorer = match_explorer(twice, twice)
    found = {round(one.temporal) for one in permutations(compare(twice, twice))}
    seen = set()
    for place in range(1, explorer.permutation.max + 1):
        explorer.permutation.value = place
        seen.add(round(explorer.match.temporal))
        assert f"permutation {place} of 2" in explorer.said.value
    assert seen == found == {67, 100}
    # A new comparison begins with the best one.
    explorer.tolerance.value = 10
    assert explorer.permutation.value == 1
    assert round(explorer.match.temporal) == 100


def test_match_explorer_takes_observations_and_pictures() -> None:
    scene = sl.SceneGraph([1, 2], [[0, 0], [0, 0]]), sl.SceneGraph([1, 2], [[0, 2], [2, 0]])
    seen = sl.Observation(scene, [3, 8], names={1: "hand"})
    assert match_explorer(seen, seen.chain).match.temporal == 100
    moving, picture = CLASS_SEEDS["moving"], np.full((8, 8, 4), 200, np.uint8)
    roles = sl.corresponding_segments(compare(moving, moving), on_tie="omit")
    explorer = match_explorer(moving, moving, pictures=(dict.fromkeys(roles, picture), {1: picture}))
    assert len(data(explorer.roles.svg, "data-role")) == len(roles) > 2
    assert len(data(explorer.roles.svg, "href")) == len(roles) + (1 in roles.values())


def test_table_explorer_counts_what_its_threshold_decides() -> None:
    chains, classes = demonstrations()
    table = similarity_table(chains)
    explorer = table_explorer(table, classes=classes)
    for threshold in (20, 64, 90):
        explorer.threshold.value = threshold
        negative, positive = threshold_errors(table, classes, thresholds_percent=threshold).iloc[0]
        assert f"{negative} false negative" in explorer.said.value
        assert f"{positive} false positive" in explorer.said.value
        marks = data(explorer.table.svg, "data-decision")
        assert (marks.count("false negative"), marks.count("false positive")) == (2 * negative, 2 * positive)
        assert data(explorer.errors.svg, "data-marker") == [str(threshold)]


def test_table_explorer_opens_the_pair_that_is_clicked_and_moves_with_the_keys() -> None:
    chains, classes = demonstrations()
    names = list(chains)
    explorer = table_explorer(chains, classes=classes, normalizer="shorter")
    assert explorer.pair.children == ()
    layout = explorer._layout
    x, y = layout.left_px + 4.5 * layout.cell_px, layout.top_px + 1.5 * layout.cell_px
    explorer.table.clicked = [x, y, 1]
    assert f"{names[1]} (putting) and {names[4]} (pouring)" in explorer.chosen.value
    (pair,) = explorer.pair.children
    assert pair.match.temporal == compare(chains[names[1]], chains[names[4]], normalizer="shorter").temporal
    explorer.table.key = ["ArrowRight", 1]
    assert pair.match.b is chains[names[5]]
    explorer.table.key = ["ArrowUp", 2]
    assert pair.match.a is chains[names[0]]
    # The same matches are shown by the same widget.
    assert explorer.pair.children == (pair,)
    explorer.table.clicked = [0, 0, 2]
    assert pair.match.a is chains[names[0]]
    assert len(data(explorer.table.svg, "data-chosen")) == 1


def test_table_explorer_without_chains_says_so() -> None:
    chains, _ = demonstrations()
    explorer = table_explorer(similarity_table(chains))
    explorer.open_pair("putting 1", "putting 2")
    assert "give the chains too" in explorer.chosen.value
    assert "no classes are known" in explorer.said.value


def test_learning_explorer_learns_from_what_is_ticked() -> None:
    chains, _ = demonstrations()
    putting = {name: chain for name, chain in chains.items() if name.startswith("putting")}
    explorer = learning_explorer(putting)
    explorer.wait()
    assert explorer.model.demonstrations == tuple(putting)
    explorer.ticks["putting 2"].value = False
    explorer.weight_threshold.value = 0.7
    explorer.wait()
    rest = {name: chain for name, chain in putting.items() if name != "putting 2"}
    expected = learn(rest, weight_threshold=0.7)
    assert explorer.model.chain.relations.tolist() == expected.chain.relations.tolist()
    assert explorer.model.row_weights.tolist() == expected.row_weights.tolist()
    n_rows, n_columns = expected.chain.relations.shape
    assert f"learned from 3 of 4 demonstrations: {n_rows} rows, {n_columns} columns" in explorer.said.value
    # What was not learned from is compared too.
    like = compare(expected.chain, putting["putting 2"]).temporal
    assert f"{like:.0f} %" in explorer._likes["putting 2"].value


def test_learning_explorer_says_what_cannot_be_learned_and_goes_on() -> None:
    chains, _ = demonstrations()
    explorer = learning_explorer(list(chains.values()))
    explorer.nothing.click()
    assert "expected at least two that are ticked, got 0" in explorer.trouble.value
    assert (explorer.model, explorer.drawing.svg, explorer.said.value) == (None, "", "")
    explorer.everything.click()
    explorer.wait()
    assert explorer.trouble.value == ""
    assert len(explorer.model.demonstrations) == len(chains)


def test_learning_explorer_names_what_online_learning_passes_over() -> None:
    chains, _ = demonstrations(n=2)
    explorer = learning_explorer(chains)
    explorer.mode.value = "online"
    explorer.wait()
    expected = learn(chains, mode="online").demonstrations
    assert explorer.model.demonstrations == expected
    for name in set(chains) - set(expected):
        assert name in explorer.said.value


def test_noise_explorer_shows_the_study_of_its_controls() -> None:
    explorer = noise_explorer({"lifting": LIFTING, "putting": SEEDS["4×6"]}, n_samples=30, random_seed=3)
    explorer.seed.value = "putting"
    explorer.mode.value = "flip only"
    explorer.p.value = 0.4
    explorer.wait()
    noise = Noise("flip only")
    study = noise_study({"seed": SEEDS["4×6"]}, rng=np.random.default_rng(3), n_samples=30, noise=noise)
    assert explorer._found.mean["similarity ψ"].tolist() == study.mean()["seed"].tolist()
    assert data(explorer.curves.svg, "data-marker") == ["0.4"]
    samples = noisy_samples(SEEDS["4×6"], 0.4, n_samples=30, rng=np.random.default_rng(3), noise=noise)
    explorer.example.value = 5
    flipped = (samples.relations[4, ::2, ::2] != SEEDS["4×6"].relations).sum()
    assert data(explorer.sample.svg, "data-mark").count("different") == flipped
    like = compare(SEEDS["4×6"], samples[4]).temporal
    assert f"sample 5: {like:.0f} %" in explorer.said.value
    explorer.n_samples.value = 10
    assert explorer.example.max == 10


def scene(n_frames: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    labels = np.ones((n_frames, 48, 64), np.uint8)
    for i in range(n_frames):
        labels[i, 10:26, 8 + 4 * i : 30 + 4 * i] = 2
        labels[i, 34:44, 40:60] = 3
    colours = np.array([[0, 0, 0], [90, 90, 90], [200, 60, 50], [60, 90, 200]])
    noise = rng.normal(0, 4, (*labels.shape, 3))
    return np.clip(colours[labels] + noise, 0, 255).astype(np.uint8), labels


def test_segmentation_explorer_segments_the_frame_of_its_controls() -> None:
    frames, truth = scene()
    explorer = segmentation_explorer(sl.Recording.from_frames(frames), truth)
    explorer.frame.value = 2
    explorer.alpha.value = 3.0
    explorer.minimum_size_px.value = 20
    explorer.anneal_sweeps.value = 5
    explorer.smooth_sweeps.value = 0
    explorer.wait()
    parameters = PottsParameters(alpha=3.0, minimum_size_px=20, anneal_sweeps=5, smooth_sweeps=0)
    assert explorer.parameters == parameters
    expected = superparamagnetic_clustering(frames[2], parameters=parameters)
    assert np.array_equal(explorer.labels, expected)
    assert f"{int(expected.max())} segment" in explorer.said.value
    assert f"3 true ones are covered by {covering(expected, truth[2]):.3f}" in explorer.said.value
    assert explorer.picture.png.startswith(b"\xff\xd8")


def test_segmentation_explorer_follows_a_movie_until_a_parameter_changes() -> None:
    frames, truth = scene()
    explorer = segmentation_explorer(frames, truth)
    explorer.wait()
    explorer.follow.click()
    explorer.wait()
    parameters = TrackingParameters(potts=explorer.parameters)
    expected = list(track_segments(sl.Recording.from_frames(frames), parameters=parameters))
    judged = quality(expected, truth)
    n_labels = len(np.unique(np.stack(expected)))
    assert f"followed through 3 frames: {n_labels} labels, covering {judged.covering:.3f}" in explorer.movie_said.value
    for place in (0, 2, 1):
        explorer.frame.value = place
        explorer.wait()
        assert np.array_equal(explorer.labels, expected[place])
    explorer.alpha.value = 2.0
    explorer.wait()
    assert explorer.movie_said.value == ""
    alone = superparamagnetic_clustering(frames[1], parameters=explorer.parameters)
    assert np.array_equal(explorer.labels, alone)


def test_segmentation_explorer_says_what_was_clicked_in_any_of_its_pictures() -> None:
    frames, truth = scene(1)
    explorer = segmentation_explorer(frames[0], truth[0])
    explorer.wait()
    assert explorer.frame.disabled
    area = int((explorer.labels == explorer.labels[15, 15]).sum())
    for number, left in enumerate((0, 70, 140), start=1):
        explorer.picture.clicked = [left + 15, 15, number]
        assert f"column 15 px, row 15 px: segment {explorer.labels[15, 15]}, {area} px" in explorer.pointed.value


def test_large_frames_are_shown_smaller_and_clicked_in_their_own_pixels() -> None:
    frame = np.zeros((120, 1000, 3), np.uint8)
    frame[:, 600:] = 220
    explorer = segmentation_explorer(frame)
    explorer.wait()
    explorer.picture.clicked = [300, 10, 1]
    assert f"column 900 px, row 30 px: segment {explorer.labels[30, 900]}," in explorer.pointed.value


BAD: dict[str, tuple[Callable[[], Explorer], str]] = {
    "match": (lambda: match_explorer(3, LIFTING), "one: expected an event chain or an observation, got int"),
    "still": (lambda: match_explorer(EventChain([[2, 2]], [(1, 2)]), LIFTING), "first chain"),
    "normaliser": (lambda: match_explorer(LIFTING, LIFTING, normalizer="other"), "normalizer: expected"),
    "names": (lambda: match_explorer(LIFTING, LIFTING, row_names="words"), "row_names: expected one of"),
    "frame": (lambda: segmentation_explorer(scene()[0], frame=3), "frame: expected one from 0 to 2, got 3"),
    "pictures": (lambda: match_explorer(LIFTING, LIFTING, pictures=([], {})), "pictures: expected two mappings"),
    "no pictures": (lambda: match_explorer(LIFTING, LIFTING, pictures={}), "pictures: expected two mappings"),
    "table": (lambda: table_explorer([[1, 2], [3, 4]]), "table: expected a table with names"),
    "classes": (lambda: table_explorer(demonstrations()[0], classes=["a"]), "classes: expected one for each of 8"),
    "learning": (lambda: learning_explorer([LIFTING]), "expected at least two demonstrations, got 1"),
    "no chain": (lambda: learning_explorer({"a": LIFTING, "b": "c"}), "chain b: expected an event chain"),
    "mode": (lambda: noise_explorer(mode="salt"), "mode: expected one of"),
    "p": (lambda: noise_explorer(p=2), "p: expected a probability from 0 to 1, got 2"),
    "seeds": (lambda: noise_explorer({}), "seeds: expected at least one"),
    "movie": (lambda: segmentation_explorer("no/such/movie.mp4"), "there is no such file"),
    "array": (lambda: segmentation_explorer(np.zeros((4, 5))), "frames: expected"),
    "truth": (lambda: segmentation_explorer(scene()[0], truth=np.zeros((2, 3)) + 0.5), "truth: expected label images"),
}


@pytest.mark.parametrize("what", list(BAD))
def test_bad_input_is_a_sentence_in_the_widget(what: str) -> None:
    make, sentence = BAD[what]
    assert sentence in make().trouble.value.replace("&#x27;", "'")


def test_truth_of_another_size_is_a_sentence_and_a_frame_beyond_it_too() -> None:
    frames, truth = scene()
    explorer = segmentation_explorer(frames, truth[:, ::2])
    explorer.wait()
    assert "truth: expected label images of 48×64 like the frames, got 24×64" in explorer.trouble.value
    explorer = segmentation_explorer(frames, truth[:1])
    explorer.wait()
    assert explorer.trouble.value == ""
    explorer.frame.value = 2
    explorer.wait()
    assert "truth: expected a label image for every frame, got none for frame 2" in explorer.trouble.value
    explorer.frame.value = 0
    explorer.wait()
    assert explorer.trouble.value == ""


def test_controls_have_labels_with_units() -> None:
    frames, _ = scene(2)
    chains, classes = demonstrations()
    explorers = [
        match_explorer(LIFTING, LIFTING), table_explorer(chains, classes), learning_explorer(chains),
        noise_explorer(n_samples=10), segmentation_explorer(frames),
    ]  # fmt: skip
    units = ("(%)", "(px)", "(no.", "(number)", "(share)", "(probability)", "(of the mean")
    for explorer in explorers:
        sliders = [
            one for one in vars(explorer).values()
            if isinstance(one, widgets.IntSlider | widgets.FloatSlider | widgets.BoundedIntText)
        ]  # fmt: skip
        assert sliders or isinstance(explorer, Explorer)
        for slider in sliders:
            assert any(unit in slider.description for unit in units), slider.description


def test_whatever_is_given_no_explorer_raises() -> None:
    movie, truth = scene(3)
    said = {
        "titles: expected two": match_explorer(LIFTING, LIFTING, titles=("one",)),
        "parameters: expected PottsParameters": segmentation_explorer(movie, parameters=3),
        "frame: expected a whole number": segmentation_explorer(movie, frame="first"),
        "truth: expected a label image for every frame, got none for frame 2": segmentation_explorer(
            movie, truth[:1], frame=2
        ),
        "truth: expected label images of": segmentation_explorer(movie, truth[:, :-4]),
        "trait of a FloatSlider instance expected a float": learning_explorer([LIFTING] * 2, weight_threshold="much"),
    }
    for sentence, explorer in said.items():
        explorer.wait()
        assert sentence in html.unescape(explorer.trouble.value)


def unpacked(page: str) -> tuple[list[float], list[str]]:
    """Values of the slider, and what a page without a kernel shows at each."""
    (data,) = re.findall(r'atob\("([^"]+)"\)', page)
    whole = json.loads(gzip.decompress(base64.b64decode(data)))
    shown = ["".join(whole["pieces"][piece] for piece in step) for step in whole["steps"]]
    return [float(value) for value in whole["values"]], shown


@pytest.mark.parametrize("kind", ["match", "table", "learning", "noise", "segmentation"])
def test_in_the_report_an_explorer_scrubs_over_one_slider(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    chains, classes = demonstrations(n=2)
    make: dict[str, Callable[[], Explorer]] = {
        "match": lambda: match_explorer(chains["putting 1"], chains["putting 2"], titles=("</script>", "b")),
        "table": lambda: table_explorer(chains, classes),
        "learning": lambda: learning_explorer(chains),
        "noise": lambda: noise_explorer({"lifting": LIFTING}, n_samples=10),
        "segmentation": lambda: segmentation_explorer(scene(1)[0]),
    }
    assert SCRUBBER not in make[kind]()._repr_mimebundle_()
    monkeypatch.setenv(FOR_PAGES, "1")
    explorer = make[kind]()
    explorer.wait()
    before = shown_html(explorer)
    page = explorer._repr_mimebundle_()[SCRUBBER]
    # Nothing is moved for good, and what stands there first is what the slider says.
    assert shown_html(explorer) == before
    control, values = explorer.scrubbed()
    told, shown = unpacked(page)
    assert told == [pytest.approx(value) for value in values]
    for place in (0, len(values) // 2):
        control.value = values[place]
        explorer.wait()
        assert shown[place] == shown_html(explorer)
    assert not network_loads(page)
    assert len(page) < 5_000_000


def test_a_page_that_would_be_too_large_has_fewer_steps() -> None:
    explorer = match_explorer(LIFTING, LIFTING)
    values = range(0, 101, 10)
    (data,) = re.findall(r'atob\("([^"]+)"\)', still_html(explorer, explorer.tolerance, values))
    page = still_html(explorer, explorer.tolerance, values, most_bytes=len(data) - 1)
    assert unpacked(page)[0] == [0, 20, 40, 60, 80, 100]
    with pytest.raises(ValueError, match="expected one that is shown within 10 bytes"):
        still_html(explorer, explorer.tolerance, [0], most_bytes=10)


def moves_of(kind: str) -> Callable[[int], None]:
    chains = dict.fromkeys("abc", LIFTING)
    if kind == "match":
        match = match_explorer(LIFTING, LIFTING)
        return lambda i: setattr(match.tolerance, "value", i % 101)
    if kind == "table":
        table = table_explorer(chains, "aab")

        def open_and_move(i: int) -> None:
            table.threshold.value = i % 101
            if i % 5 == 0:
                table.open_pair("abc"[i % 3], "abc"[i // 3 % 3])

        return open_and_move
    if kind == "noise":
        noise = noise_explorer({"lifting": LIFTING}, n_samples=10)
        return lambda i: setattr(noise.p, "value", (i % 101) / 100)
    if kind == "learning":
        learning = learning_explorer(chains)

        def learn_anew(i: int) -> None:
            learning.weight_threshold.value = (i % 21) / 20
            learning.wait()

        return learn_anew
    if kind == "push":
        push = push_explorer()
        # Of the arm's own process another test takes care.
        seen = View(np.zeros((256, 320, 3), np.uint8), np.ones((256, 320), np.float32), push.scene.camera)
        push._arm.look = lambda _: seen

        def place_anew(i: int) -> None:
            push.x.value = 0.2 + (i % 40) / 200
            push.wait()

        return place_anew
    frames, _ = scene(2)
    segmentation = segmentation_explorer(frames)

    def segment_anew(i: int) -> None:
        segmentation.alpha.value = 0.1 + (i % 99) / 10
        segmentation.wait()

    return segment_anew


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["match", "table", "noise", "learning", "segmentation", "push"])
def test_nothing_is_left_behind_by_a_thousand_moves(kind: str) -> None:
    n_moves = 1000
    move = moves_of(kind)
    for i in range(100):
        move(i)
    gc.collect()
    n_objects, n_threads = len(gc.get_objects()), threading.active_count()
    n_widgets = len(widgets.widget._instances)
    for i in range(n_moves):
        move(i)
    gc.collect()
    assert len(widgets.widget._instances) == n_widgets
    assert threading.active_count() <= n_threads
    # A leak of one object a move would be a thousand.
    assert len(gc.get_objects()) - n_objects < n_moves / 2


def test_frames_are_read_once_while_one_scrubs_on_and_anew_when_one_goes_far_back() -> None:
    n_begun = 0

    class Frames:
        def __iter__(self):  # type: ignore[no-untyped-def]
            nonlocal n_begun
            n_begun += 1
            return iter(range(50))

    shelf, reports = FrameShelf(Frames(), kept=5), []
    assert [shelf.at(i) for i in (0, 3, 3, 9, 7, 20)] == [0, 3, 3, 9, 7, 20]
    assert n_begun == 1
    assert shelf.at(2, report=lambda done, total: reports.append((done, total))) == 2
    assert n_begun == 2
    assert reports == [(1, 3), (2, 3), (3, 3)]
    with pytest.raises(ValueError, match="frame: expected one from 0 to 49, got 50"):
        shelf.at(50)
    assert shelf.at(49) == 49
