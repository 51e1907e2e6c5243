import subprocess
import sys

import pytest
from traitlets import TraitError

import sec_lab.viz.widgets as widgets
from sec_lab.viz.widgets import ClickablePicture


def test_clicks_and_keys_are_told_each_time() -> None:
    picture = ClickablePicture(png=b"one", description="a chain")
    clicks: list[tuple[int, int]] = []
    keys: list[str] = []
    picture.on_click(lambda x, y: clicks.append((x, y)))
    picture.on_key(keys.append)
    for n in (1, 2):
        picture.clicked = [3, 4, n]
        picture.key = ["ArrowLeft", n]
    assert clicks == [(3, 4), (3, 4)]
    assert keys == ["ArrowLeft", "ArrowLeft"]


def test_a_width_below_zero_is_refused() -> None:
    with pytest.raises(TraitError, match="width"):
        ClickablePicture(width=-1)


def test_the_page_script_loads_nothing() -> None:
    script = str(ClickablePicture._esm) + str(ClickablePicture._css)
    assert "://" not in script
    assert "import " not in script


def test_widgets_are_imported_when_they_are_used() -> None:
    code = "import sec_lab.viz.widgets, sys; print(*({'ipywidgets', 'anywidget'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"
    assert set(dir(widgets)) == set(widgets.__all__)
    for name in widgets.__all__:
        assert getattr(widgets, name)
    with pytest.raises(AttributeError, match="no_such_widget"):
        _ = widgets.no_such_widget
