"""Moves every control that the widgets of a cell show, as a hand would, and looks whether the page follows."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Locator, Page

SCRIPT = Path(__file__).with_suffix(".js").read_text(encoding="utf-8")
MOST_OPTIONS = 6
WORD, UPLOADED = "typed_by_hand", "uploaded_by_hand"
PLACES = ((0.5, 0.5), (0.3, 0.6), (0.75, 0.3), (0.2, 0.25))
KEYS = ("ArrowRight", "ArrowDown", "ArrowLeft")
STATELESS = ("picture", "keys", "button", "play", "upload")
"""Kinds of which the page does not show where they stand."""
READ_BY = {"a file, or a folder of pictures": "open", "of a tracker, if you have any": "open", "save as": "save"}
"""Texts that are read when a button is pressed; the page then shows what was typed."""
STOPPED_ONLY = frozenset({"push"})
"""Work that is begun and cancelled here; another test waits for its end."""


@dataclass(frozen=True)
class Moved:
    """A control, and what came of moving it.

    Attributes
    ----------
    kind, name : str
    n_tried, n_followed : int
        Settings that were tried, and those after which the page showed something else.
    slowest_ms : float
        From the hand to the first change of the page, or to the progress bar.
    said : tuple of str
        Sentences about something wrong that came up.
    """

    kind: str
    name: str
    n_tried: int
    n_followed: int
    slowest_ms: float
    said: tuple[str, ...]


class Walk:
    """The controls of a cell, as they are now; they come and go."""

    def __init__(self, page: Page, cell: Locator) -> None:
        self.page, self.cell = page, cell
        self.cancels: dict[str, Moved] = {}
        self._node = cell.element_handle()
        page.evaluate(SCRIPT)

    def ask(self, what: str, *given: object) -> Any:
        """Call a function of the script in the page for this cell."""
        return self.page.evaluate(f"(given) => secLabControls.{what}(...given)", [self._node, *given])

    def controls(self) -> list[dict[str, Any]]:
        """Also the keys of pictures, where the hint promises that they do something."""
        found: list[dict[str, Any]] = self.ask("controls")
        keyed = [one for one in found if one["kind"] == "picture" and ("keys" in one["hint"] or "←" in one["hint"])]
        return [*found, *({**one, "kind": "keys", "name": f"{one['name']}, by keys"} for one in keyed)]

    def at(self, control: dict[str, Any]) -> Locator:
        return self.cell.locator(f"[data-control='{control['id']}']")

    def named(self, name: str) -> Locator:
        return self.at(next(one for one in self.controls() if one["name"] == name))

    def has(self, name: str) -> bool:
        return any(one["name"] == name for one in self.controls())

    def choose(self, name: str, *places: int) -> None:
        """Choose options of a list by their places."""
        self.named(name).locator("select").select_option(index=list(places))

    def read(self, name: str, value: str) -> None:
        """Let a slider stand somewhere, by what it reads."""
        readout = self.named(name).locator(".widget-readout")
        readout.fill(value)
        readout.press("Enter")


def _choose_a_pair(walk: Walk) -> None:
    """A pair of chains to which several permutations are left: the second of a table; they get fewer with tolerance."""
    walk.read("tolerance (%)", "0")
    pairs = walk.cell.locator("[data-cell]")
    if pairs.count():
        pairs.nth(1).click()


def _tell_rows_apart(walk: Walk) -> None:
    """Learning where the lengths of rows count: for the real demonstrations, in this mode and tolerance only."""
    if walk.has("mode"):
        walk.named("mode").get_by_role("button", name="online").click()
        walk.read("tolerance (%)", "50")


PREPARED: dict[str, Callable[[Walk], object]] = {
    "name of the chosen segment": lambda walk: walk.choose("segments", 0),
    "name": lambda walk: walk.choose("segments"),
    "merge": lambda walk: walk.choose("segments", 0, 1),
    "push": lambda walk: walk.choose("scene", 0),
    "permutation (no.)": _choose_a_pair,
    "divide by the": _tell_rows_apart,
}
"""What must be so that a control can do something: how many segments are chosen, that things lie apart, …"""


def move_every_control(page: Page, cell: Locator) -> list[Moved]:
    """Move all visible controls of a cell that can be moved, those too that appear meanwhile; buttons come last.

    What counts as following is a picture's pixels, a drawing, or a sentence or table; neither what the control itself
    shows nor what other controls do. A control that nothing follows is tried once more after all others.

    Parameters
    ----------
    page : Page
    cell : Locator
        Its widgets are shown and at rest.

    Returns
    -------
    list of Moved
        In the order in which they were moved; buttons that cancel work among them.
    """
    walk = Walk(page, cell)
    walk.ask("rest")
    moved: dict[str, Moved] = {}
    again: list[dict[str, Any]] = []
    while (control := _next(walk, moved)) is not None:
        _move(walk, control, moved)
        if not moved[_key(control)].n_followed:
            again.append(control)
    # The last ones first: they may undo what others have done.
    for control in reversed(again):
        if _key(control) in map(_key, walk.controls()):
            _move(walk, control, moved)
    return [*moved.values(), *walk.cancels.values()]


def left_out(page: Page, cell: Locator, moved: list[Moved]) -> list[str]:
    """Names of visible controls that could never be moved."""
    names = {one.name for one in moved}
    return [control["name"] for control in Walk(page, cell).controls() if control["name"] not in names]


def _key(control: dict[str, Any]) -> str:
    return f"{control['id']} {control['kind']}"


def _next(walk: Walk, moved: dict[str, Moved]) -> dict[str, Any] | None:
    found = [one for one in walk.controls() if _key(one) not in moved]
    found = [one for one in found if one["isEnabled"] or one["name"] in PREPARED]
    return min(found, key=lambda one: one["kind"] == "button", default=None)


def _move(walk: Walk, control: dict[str, Any], moved: dict[str, Moved]) -> None:
    """Try the settings of a control one after the other."""
    if control["name"] in PREPARED:
        PREPARED[control["name"]](walk)
        walk.ask("rest")
    one, node = walk.at(control), walk.at(control).element_handle()
    outcomes = []
    moves = MOVES[control["kind"]](walk, one, control)
    while True:
        walk.ask("look", node)
        word = next(moves, None)
        if word is None:
            break
        outcome = walk.ask("after", node, control["kind"] not in STATELESS)
        outcome["isFollowed"] &= word in outcome["words"]
        outcomes.append(outcome)
    walk.ask("rest")
    moved[_key(control)] = Moved(
        control["kind"],
        control["name"],
        n_tried=sum(outcome["isMoved"] for outcome in outcomes),
        n_followed=sum(outcome["isFollowed"] for outcome in outcomes),
        slowest_ms=max((outcome["ms"] for outcome in outcomes), default=0.0),
        said=tuple(words for outcome in outcomes for words in outcome["said"]),
    )


def _point(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    for across, down in PLACES:
        box = one.bounding_box()
        assert box is not None
        one.click(position={"x": across * box["width"], "y": down * box["height"]})
        yield ""


def _press_keys(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    for key in KEYS:
        one.press(key)
        yield ""


def _slide(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    readout = one.locator(".widget-readout:visible")
    was = readout.inner_text() if readout.count() else None
    for handle in one.locator(".noUi-handle").all():
        for key in ("End", "Home", "ArrowRight"):
            handle.press(key)
            yield ""
    if was is not None:
        readout.fill(was)
        readout.press("Enter")


def _toggle(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    was = one.locator("button.mod-active").inner_text()
    for option in one.locator("button").all():
        option.click()
        yield ""
    one.get_by_role("button", name=was, exact=True).click()


def _drop(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    box = one.locator("select")
    was = box.input_value()
    for place in range(min(box.locator("option").count(), MOST_OPTIONS)):
        box.select_option(index=place)
        yield ""
    box.select_option(was)


def _list(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    box = one.locator("select")
    n_options = min(box.locator("option").count(), MOST_OPTIONS)
    for places in (*([place] for place in range(n_options)), [*range(n_options)], []):
        box.select_option(index=places)
        yield ""


def _tick(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    for _ in range(2):
        one.locator("input").click()
        yield ""


def _play(walk: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    play, stop = one.locator("button").first, one.locator("button").nth(1)
    play.click()
    walk.ask("changes", 5_000)
    play.click()
    yield ""
    stop.click()
    yield ""


def _count(_: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    field = one.locator("input")
    was = field.input_value()
    for number in ("1", "7"):
        field.fill(number)
        field.press("Enter")
        yield ""
    field.fill(was)
    field.press("Enter")


def _type(walk: Walk, one: Locator, control: dict[str, Any]) -> Iterator[str]:
    field, button = one.locator("input"), READ_BY.get(control["name"])
    was = field.input_value()
    field.fill(WORD)
    field.press("Enter")
    if button is not None:
        walk.named(button).click()
    yield WORD if button is not None else ""
    field.fill(was)
    field.press("Enter")


def _upload(walk: Walk, one: Locator, __: dict[str, Any]) -> Iterator[str]:
    """A file that is no movie, which the page must say; fields that then name it are put back."""
    fields = walk.cell.locator("input[type=text]:visible").all()
    before = [field.input_value() for field in fields]
    one.locator("input").set_input_files({"name": f"{UPLOADED}.mp4", "mimeType": "video/mp4", "buffer": b"no movie"})
    walk.ask("changes", 10_000)
    yield UPLOADED
    for field, was in zip(fields, before, strict=True):
        field.fill(was)
        field.press("Enter")


def _press(walk: Walk, one: Locator, control: dict[str, Any]) -> Iterator[str]:
    """Press a button; work that it begins is cancelled, and begun anew."""
    one.click()
    cancelled = walk.ask("cancel")
    yield ""
    if cancelled is not None:
        name = f"{cancelled['name']} ({control['name']})"
        walk.cancels[name] = Moved("button", name, n_tried=1, n_followed=1, slowest_ms=cancelled["ms"], said=())
        if control["name"] not in STOPPED_ONLY:
            one.click()
            yield ""


MOVES: dict[str, Callable[[Walk, Locator, dict[str, Any]], Iterator[str]]] = {
    "picture": _point,
    "keys": _press_keys,
    "slider": _slide,
    "toggles": _toggle,
    "dropdown": _drop,
    "list": _list,
    "checkbox": _tick,
    "play": _play,
    "number": _count,
    "text": _type,
    "upload": _upload,
    "button": _press,
}
"""How a control of each kind is moved; each move is followed by what the page must then say, or by nothing."""
