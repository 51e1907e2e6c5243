"""``push(scene)`` as a widget calls it, and the strip of what was seen."""

from dataclasses import replace

import numpy as np
import pytest

from sec_lab.execution.planning import SceneError
from sec_lab.execution.pushing import push, pushing_skill
from sec_lab.viz.watched import draw_strips, start_of_last_attempt
from sec_lab.worlds.katana import Fault, example_scene


def test_the_skill_is_learned_once() -> None:
    assert pushing_skill() is pushing_skill()


def test_a_scene_without_a_red_thing_is_refused() -> None:
    scene = example_scene("b")
    with pytest.raises(SceneError, match="expected something that looks like 'red box'"):
        push(replace(scene, things=scene.things[1:]))


@pytest.mark.slow
def test_a_push_succeeds_and_can_be_shown() -> None:
    """A missed first attempt, so that the last one does not begin with the recording."""
    scene = example_scene("c")
    done = push(scene, fault=Fault("missed", "over", offset_m=(0.0, 0.09)))
    assert done.success
    assert done.n_attempts == 2
    assert done.truth.touching("red box", "green box")[-1]
    start = start_of_last_attempt(done)
    assert 0 < start < len(done.recording)
    # The arm is away when the second attempt begins, and nothing is pushed yet.
    assert not done.truth.touching("red box", "green box")[start]
    assert np.linalg.norm(done.truth.tip_m[start] - scene.home_m) < 0.01
    figure = draw_strips({"(c)": done})
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "start", "after N→T", "after N→T", "after T→N", "after N→A",
    ]  # fmt: skip
