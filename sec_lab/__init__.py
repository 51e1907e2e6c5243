"""Semantic event chains: from the movie of a manipulation to a small table, and what follows from it.

The rooms of this package follow the block diagram of Aksoy's dissertation (2012, Fig. 2.2); nearly every public
name below is imported on first use, so that ``import sec_lab`` costs little.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

# A room and its function have this one name. Importing the room binds the room to it, once; so the function has to be
# bound after that, here.
from sec_lab.event_chain import event_chain as event_chain

if TYPE_CHECKING:
    import sec_lab.graphml as graphml
    from sec_lab.action_model import ActionModel as ActionModel
    from sec_lab.classification import unsupervised_classes as unsupervised_classes
    from sec_lab.codes import Relation as Relation
    from sec_lab.event_chain import EventChain as EventChain
    from sec_lab.learning import OnlineLearner as OnlineLearner
    from sec_lab.learning import learn as learn
    from sec_lab.learning import learn_types as learn_types
    from sec_lab.observation import Observation as Observation
    from sec_lab.pipeline import observe as observe
    from sec_lab.pipeline import observe_segments as observe_segments
    from sec_lab.recording import Recording as Recording
    from sec_lab.roles import AmbiguousRoleError as AmbiguousRoleError
    from sec_lab.roles import corresponding_segments as corresponding_segments
    from sec_lab.scene_graph import SceneGraph as SceneGraph
    from sec_lab.scene_graph import main_graphs as main_graphs
    from sec_lab.segmentation import Segmentation as Segmentation
    from sec_lab.similarity import Match as Match
    from sec_lab.similarity import compare as compare
    from sec_lab.similarity import similarity_table as similarity_table

__version__ = "0.1.0"

_ROOM_OF = {
    "ActionModel": "action_model",
    "AmbiguousRoleError": "roles",
    "EventChain": "event_chain",
    "Match": "similarity",
    "Observation": "observation",
    "OnlineLearner": "learning",
    "Recording": "recording",
    "Relation": "codes",
    "SceneGraph": "scene_graph",
    "Segmentation": "segmentation",
    "compare": "similarity",
    "corresponding_segments": "roles",
    "learn": "learning",
    "learn_types": "learning",
    "main_graphs": "scene_graph",
    "observe": "pipeline",
    "observe_segments": "pipeline",
    "similarity_table": "similarity",
    "unsupervised_classes": "classification",
}
_ROOMS = ("graphml",)
__all__ = ["__version__", "event_chain", *_ROOM_OF, *_ROOMS]


def __getattr__(name: str) -> Any:
    if name in _ROOM_OF:
        value = getattr(import_module(f"sec_lab.{_ROOM_OF[name]}"), name)
    elif name in _ROOMS:
        value = import_module(f"sec_lab.{name}")
    else:
        raise AttributeError(f"module 'sec_lab' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
