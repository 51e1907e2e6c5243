"""Widgets: what the figures show, answering to the hand; one line in any notebook, on one's own data too.

What a widget shows is computed and drawn by plain functions in modules without ipywidgets; the widget only joins them
to its controls. Each is imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sec_lab.viz.widgets.explorer import ChainExplorer as ChainExplorer
    from sec_lab.viz.widgets.explorer import chain_explorer as chain_explorer
    from sec_lab.viz.widgets.learning import learning_explorer as learning_explorer
    from sec_lab.viz.widgets.match import match_explorer as match_explorer
    from sec_lab.viz.widgets.noise import noise_explorer as noise_explorer
    from sec_lab.viz.widgets.own_movie import OwnMovie as OwnMovie
    from sec_lab.viz.widgets.own_movie import own_movie as own_movie
    from sec_lab.viz.widgets.picture import ClickablePicture as ClickablePicture
    from sec_lab.viz.widgets.push import PushExplorer as PushExplorer
    from sec_lab.viz.widgets.push import push_explorer as push_explorer
    from sec_lab.viz.widgets.segmentation import segmentation_explorer as segmentation_explorer
    from sec_lab.viz.widgets.table import table_explorer as table_explorer

_MODULE_OF = {
    "ChainExplorer": "explorer",
    "ClickablePicture": "picture",
    "OwnMovie": "own_movie",
    "PushExplorer": "push",
    "chain_explorer": "explorer",
    "learning_explorer": "learning",
    "match_explorer": "match",
    "noise_explorer": "noise",
    "push_explorer": "push",
    "segmentation_explorer": "segmentation",
    "table_explorer": "table",
    "own_movie": "own_movie",
}
__all__ = list(_MODULE_OF)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'sec_lab.viz.widgets' has no attribute {name!r}")
    value = getattr(import_module(f"sec_lab.viz.widgets.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
