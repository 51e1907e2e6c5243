"""Widgets: what the figures show, answering to the hand; one line in any notebook, on one's own data too.

What a widget shows is computed and drawn by plain functions in modules without ipywidgets; the widget only joins them
to its controls. Each is imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sec_lab.viz.widgets.explorer import ChainExplorer as ChainExplorer
    from sec_lab.viz.widgets.explorer import chain_explorer as chain_explorer
    from sec_lab.viz.widgets.own_movie import OwnMovie as OwnMovie
    from sec_lab.viz.widgets.own_movie import own_movie as own_movie
    from sec_lab.viz.widgets.picture import ClickablePicture as ClickablePicture

_MODULE_OF = {
    "ChainExplorer": "explorer",
    "ClickablePicture": "picture",
    "OwnMovie": "own_movie",
    "chain_explorer": "explorer",
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
