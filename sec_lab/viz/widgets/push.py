"""Push explorer: place things, press *push*, watch the arm, and see the executed chain against the model (§2.10)."""

from typing import Any, get_args

import ipywidgets as widgets
import numpy as np

from sec_lab.execution.account import moments, outcome_sentence, refusal_sentence, verdict_sentence
from sec_lab.execution.loop import Verdict
from sec_lab.execution.skill import Skill
from sec_lab.viz.arm import live_frame
from sec_lab.viz.arm_process import ArmProcess, Pushed
from sec_lab.viz.svg.paper import png, sentence
from sec_lab.viz.svg.pushed import pushed_svg, strip_svg, verdicts_html
from sec_lab.viz.svg.table_top import place_of, table_svg
from sec_lab.viz.watched import frames_at
from sec_lab.viz.widgets.base import INSET, LABELS, TOGGLES, Explorer, never_raises, row_of
from sec_lab.viz.widgets.drawing import Drawing
from sec_lab.viz.widgets.latest import Turn
from sec_lab.viz.widgets.picture import ClickablePicture
from sec_lab.worlds.katana import Scene, View, example_scene, random_scene
from sec_lab.worlds.katana.arranging import (
    Third,
    angles_of,
    check_apart,
    rearranged,
    seen_from,
    table_place,
    thing_at,
    third_of,
    with_third,
)
from sec_lab.worlds.katana.records import Form
from sec_lab.worlds.katana.scenes import Example

_OWN, _RANDOM = "own", "random"
_X_M, _Y_M, _SIZE_MM, _TURN_DEG = (0.05, 0.50), (-0.28, 0.28), (30, 100), (-90, 90)
_NARROW = {"width": "300px"}
_MOST_WAIT_S = 600.0


class PushExplorer(Explorer):
    """A table to put things on, an arm that pushes, and what came of it; made by :func:`push_explorer`.

    Attributes
    ----------
    which, seed, third, azimuth, elevation : ipywidgets widgets
        Where the scene comes from, and its camera.
    thing, shape, x, y, turn, size : ipywidgets widgets
        The chosen thing.
    table : Drawing
        From above; a click on a thing chooses it, a click beside it moves the chosen one there.
    camera : ClickablePicture
        What the camera sees; clicks do the same.
    push, live : ipywidgets widgets
    view_3d : ipywidgets.HTML
        The arm, live while it pushes, then as a recording.
    said, verdicts : ipywidgets.HTML
        How it ended, and what the arm said of itself after every rule.
    strip, chains : Drawing
        The camera's pictures after every rule, and the executed chain beside the model.
    pushed : Pushed or None
        The last push; None before the first, after a refusal and after the scene has changed.
    """

    def __init__(self, scene: Scene | None, *, skill: Skill | None, live: bool) -> None:
        super().__init__()
        self._given = scene
        self._scene = example_scene("a") if scene is None else scene
        self.pushed: Pushed | None = None
        self._arm = ArmProcess(skill)
        self._is_setting = self._is_pushing = False
        self._told: list[Verdict] = []
        self._make_controls(live=live)
        self._worker = self.latest(self._show_made)
        self.show(
            row_of(self.which, self.seed, self.third),
            row_of(self.azimuth, self.elevation),
            row_of(self.thing, self.shape),
            row_of(self.x, self.y),
            row_of(self.turn, self.size),
            row_of(self.table, self.camera),
            row_of(self.push, self.live, self.work_bar),
            self.said, self.verdicts, self.view_3d, self.strip, self.chains,
        )  # fmt: skip
        self._set_controls()
        self._listen()
        self._draw()

    @property
    def scene(self) -> Scene:
        """The scene as it stands there."""
        return self._scene

    def wait(self) -> None:
        """Wait until the camera's picture, or the push, is shown."""
        self._worker.wait(_MOST_WAIT_S)

    def close(self) -> None:
        """End the arm's process, too."""
        self._worker.cancel()
        self._arm.close()
        super().close()

    def say_trouble(self, text: str) -> None:
        """Show a sentence that says what went wrong; the controls can be used again."""
        super().say_trouble(text)
        if text and self._is_pushing:
            self._rest()
            self.view_3d.value = ""

    def _make_controls(self, *, live: bool) -> None:
        examples = [(f"like Fig. 2.20 ({letter})", letter) for letter in get_args(Example)]
        own = [] if self._given is None else [("the given one", _OWN)]
        self.which = widgets.Dropdown(
            options=[*own, *examples, ("random", _RANDOM)], description="scene", style=LABELS, layout={"width": "220px"}
        )
        self.seed = widgets.BoundedIntText(
            value=0, min=0, max=10**6, description="seed (number)", style=LABELS, layout={"width": "180px"}
        )
        self.third = widgets.Dropdown(
            options=list(get_args(Third)), description="third thing", style=LABELS, layout={"width": "220px"}
        )
        self.azimuth = _slider("camera azimuth (°)", -55, 55, 1)
        self.elevation = _slider("camera elevation (°)", 42, 62, 1)
        self.thing = widgets.ToggleButtons(options=self._names(), description="thing", style=TOGGLES, layout=INSET)
        self.shape = widgets.ToggleButtons(
            options=list(get_args(Form)), description="shape", style=TOGGLES, layout=INSET
        )
        self.x, self.y = _slider("x (m)", *_X_M, 0.005), _slider("y (m)", *_Y_M, 0.005)
        self.turn, self.size = _slider("turn (°)", *_TURN_DEG, 1), _slider("size (mm)", *_SIZE_MM, 1)
        hint = "click a thing to choose it, click beside it to move the chosen one there"
        self.table = Drawing(takes_clicks=True, hint=hint)
        self.camera = ClickablePicture(width=320, description="what the camera sees", tooltip=hint)
        self.push = widgets.Button(description="push", icon="play", button_style="primary", tooltip="let the arm push")
        self.live = widgets.Checkbox(value=live, description="live 3D view", indent=False, layout={"width": "auto"})
        self.said, self.verdicts, self.view_3d = widgets.HTML(), widgets.HTML(), widgets.HTML(layout={"width": "100%"})
        self.strip, self.chains = Drawing(), Drawing()

    def _listen(self) -> None:
        self.on_move([self.which], self._choose_scene)
        self.on_move([self.seed], self._choose_seed)
        self.on_move([self.third], lambda: self._change(with_third(self._scene, self.third.value)))
        self.on_move([self.azimuth, self.elevation], self._turn_camera)
        self.on_move([self.thing], self._choose_thing)
        self.on_move([self.shape], lambda: self._rearrange(shape=self.shape.value))
        self.on_move([self.x, self.y], lambda: self._rearrange(at_m=(self.x.value, self.y.value)))
        self.on_move([self.turn], lambda: self._rearrange(yaw_rad=float(np.deg2rad(self.turn.value))))
        self.on_move([self.size], lambda: self._rearrange(size_m=self.size.value / 1000))
        self.table.on_click(lambda x, y: self._click(*place_of(x, y)))
        self.camera.on_click(lambda column, row: self._click(*table_place(self._scene.camera, column, row)))
        self.push.on_click(lambda _: self._push())
        self.cancel.on_click(lambda _: self._stopped())

    def _names(self) -> list[tuple[str, int]]:
        return [(thing.name, number) for number, thing in enumerate(self._scene.things)]

    def _set_controls(self) -> None:
        """Let the controls say what the scene is."""
        self._is_setting = True
        scene = self._scene
        chosen = min(self.thing.value or 0, len(scene.things) - 1)
        if list(self.thing.options) != self._names():
            self.thing.options = self._names()
        self.thing.value = chosen
        one = scene.things[chosen]
        azimuth, elevation = angles_of(scene.camera)
        turn = (np.rad2deg(one.yaw_rad) + 90) % 180 - 90
        self.shape.value, self.third.value = one.shape, third_of(scene)
        for slider, value in (
            (self.x, one.p_W_m[0]), (self.y, one.p_W_m[1]), (self.turn, turn), (self.size, 1000 * one.size_m[0]),
            (self.azimuth, azimuth), (self.elevation, elevation),
        ):  # fmt: skip
            slider.value = min(max(float(value), slider.min), slider.max)
        self._is_setting = False

    def _change(self, scene: Scene) -> None:
        if self._is_setting or self._is_pushing:
            return
        self._scene = scene
        self._set_controls()
        self._draw()

    def _choose_scene(self) -> None:
        if self.which.value == _OWN and self._given is not None:
            self._change(self._given)
        elif self.which.value == _RANDOM:
            self._change(random_scene(self.seed.value))
        else:
            self._change(example_scene(self.which.value))

    def _choose_seed(self) -> None:
        if self.which.value == _RANDOM:
            self._choose_scene()
        else:
            self.which.value = _RANDOM

    def _turn_camera(self) -> None:
        if not self._is_setting:
            self._change(
                seen_from(self._scene, azimuth_deg=self.azimuth.value, elevation_deg=self.elevation.value)
            )  # fmt: skip

    def _choose_thing(self) -> None:
        if not self._is_setting:
            self._set_controls()
            self._draw_table()

    def _rearrange(self, **what: Any) -> None:
        if not self._is_setting:
            self._change(rearranged(self._scene, self.thing.value, **what))

    def _click(self, x_m: float, y_m: float) -> None:
        if self._is_pushing:
            return
        with self.guard():
            number = thing_at(self._scene, x_m, y_m)
            if number is not None:
                self.thing.value = number
                return
            x, y = (float(np.clip(round(value, 3), *most)) for value, most in ((x_m, _X_M), (y_m, _Y_M)))
            self._rearrange(at_m=(x, y))

    def _draw(self) -> None:
        """Show the scene anew; what was pushed before was another one."""
        self._clear()
        self._draw_table()
        scene = self._scene
        self._worker.ask(lambda _: self._arm.look(scene), patience_s=0)

    def _draw_table(self) -> None:
        after = () if self.pushed is None else self.pushed.outcome.scene.things
        self.table.svg = table_svg(self._scene, chosen=self.thing.value, afterwards=after)

    def _clear(self) -> None:
        self.pushed, self._told = None, []
        for shown in (self.said, self.verdicts, self.view_3d):
            shown.value = ""
        self.strip.svg = self.chains.svg = ""

    def _push(self) -> None:
        if self._is_pushing:
            return
        self.say_trouble("")
        self._clear()
        self._draw_table()
        self._is_pushing = True
        self._enable()
        self.said.value = sentence("The arm looks, plans and pushes …")
        scene, is_live = self._scene, bool(self.live.value)
        self._worker.ask(lambda turn: self._pushed(turn, scene, is_live=is_live), patience_s=0)

    def _pushed(self, turn: Turn, scene: Scene, *, is_live: bool) -> Pushed:
        """What the worker does; it changes no widget by itself."""

        def on_live(url: str) -> None:
            if is_live:
                turn.show(lambda: setattr(self.view_3d, "value", live_frame(url)))

        try:
            check_apart(scene)
            # The picture of what was changed last may not have been asked for yet.
            seen = self._arm.look(scene)
            turn.show(lambda: setattr(self.camera, "png", png(seen.image)))
            return self._arm.push(
                scene, report=turn.report, on_live=on_live,
                on_verdict=lambda verdict: turn.show(lambda: self._show_verdict(verdict)),
            )  # fmt: skip
        except ValueError as error:
            raise ValueError(refusal_sentence(str(error))) from None

    def _show_verdict(self, verdict: Verdict) -> None:
        self._told.append(verdict)
        self.verdicts.value = verdicts_html([(one.agrees, verdict_sentence(one)) for one in self._told])

    def _show_made(self, made: View | Pushed) -> None:
        if isinstance(made, View):
            self.camera.png = png(made.image)
            return
        self._rest()
        self.pushed, outcome = made, made.outcome
        self.said.value = sentence(outcome_sentence(outcome))
        self.verdicts.value = verdicts_html([(one.agrees, verdict_sentence(one)) for one in outcome.verdicts])
        self.view_3d.value = made.recording._repr_html_()
        numbers, titles = zip(*moments(outcome), strict=True)
        self.strip.svg = strip_svg([frame.image for frame in frames_at(outcome.recording, numbers)], titles)
        self.chains.svg = pushed_svg(made.model, outcome.chain)
        self._draw_table()

    def _stopped(self) -> None:
        if self._is_pushing:
            self._rest()
            self.view_3d.value = ""
            self.said.value = sentence("Stopped between two moves; press push to begin anew.")

    def _rest(self) -> None:
        self._is_pushing = False
        self.said.value = ""
        self._enable()

    def _enable(self) -> None:
        for control in (
            self.which, self.seed, self.third, self.azimuth, self.elevation, self.thing, self.shape, self.x, self.y,
            self.turn, self.size, self.push, self.live,
        ):  # fmt: skip
            control.disabled = self._is_pushing


@never_raises
def push_explorer(scene: Scene | None = None, *, skill: Skill | None = None, live: bool = True) -> Explorer:
    """Place things on the arm's table, let it push, and see what it did and what it said of it (Fig. 2.19 to 2.21).

    The arm works in a process of its own, which is started when it is needed and ends with the explorer or the kernel.

    Parameters
    ----------
    scene : Scene, optional
        To begin with; that of Fig. 2.20 (a) if left out.
    skill : Skill, optional
        What the arm has learned; pushing, from the demonstrations of the repository, if left out.
    live : bool, optional
        Whether the 3D view is shown while the arm moves, from an address that only this machine can open. The recording
        that is shown afterwards plays anywhere.

    Returns
    -------
    PushExplorer
        Or, if something is wrong with what was given, an explorer that says what.

    Examples
    --------
    >>> explorer = push_explorer()
    >>> explorer.shape.value = "sphere"
    >>> explorer.scene.things[0].name
    'red sphere'
    >>> explorer.close()
    """
    # Here, as a widget that is half made cannot be closed.
    if scene is not None and not isinstance(scene, Scene):
        raise TypeError(f"scene: expected a Scene, got {type(scene).__name__}")
    if scene is not None and len(scene.things) < 2:
        raise ValueError(f"scene: expected two things at least, got {len(scene.things)}")
    if skill is not None and not isinstance(skill, Skill):
        raise TypeError(f"skill: expected a Skill, got {type(skill).__name__}")
    return PushExplorer(scene, skill=skill, live=live)


def _slider(label: str, least: float, most: float, step: float) -> widgets.FloatSlider:
    return widgets.FloatSlider(
        min=least, max=most, step=step, description=label, style=LABELS, layout=_NARROW,
        readout_format=".0f" if step >= 1 else ".3f",
    )  # fmt: skip
