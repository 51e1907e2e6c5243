"""One push — simulate, render, perceive, judge — against the time that passes in the simulation.

No test passes or fails on a time; what is printed are ratios of the same run.
"""

import time
from pathlib import Path

from pytest_benchmark.fixture import BenchmarkFixture

from sec_lab.execution.loop import Outcome, execute_skill
from sec_lab.execution.perception import Watcher
from sec_lab.execution.study import skill_of
from sec_lab.worlds.katana import example_scene
from sec_lab.worlds.katana.stored import read_demonstration

DEMONSTRATIONS = Path(__file__).parents[2] / "datasets" / "katana_pushing"


def test_a_push_against_its_simulated_time(benchmark: BenchmarkFixture) -> None:
    skill = skill_of(read_demonstration(DEMONSTRATIONS / f"demonstration_0{number}.npz") for number in (3, 4))
    scene = example_scene("c")
    done: Outcome = benchmark.pedantic(execute_skill, args=(scene, skill), rounds=1, warmup_rounds=1)
    begin = time.process_time()
    watcher = Watcher(scene.camera, frames_per_second=20.0)
    for frame in done.recording:
        watcher.add(frame)
    perceiving = time.process_time() - begin
    took = benchmark.stats.stats.min if benchmark.stats else float("nan")
    print(
        f"\n{done.time_s:.1f} s simulated, {took:.1f} s taken, {took / done.time_s:.2f} of it; "
        f"of which perceiving {perceiving:.1f} s"
    )
