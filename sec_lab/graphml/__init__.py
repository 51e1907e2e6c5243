"""Observations and event chains in files: the thesis's GraphML dialect (A.2), standard GraphML, and tables.

============================  =========================================================================
:func:`read`, :func:`write`   an :class:`~sec_lab.observation.Observation` in either GraphML, or an
                              :class:`~sec_lab.action_model.ActionModel` in standard GraphML
:func:`read_observation`      as :func:`read`, but nothing else than an observation
:func:`read_model`            as :func:`read`, but nothing else than a model
:func:`read_chain`            the event chain of a GraphML file or of a table, told apart by content
:func:`read_table`            the event chain of a 0/1/9 table (``SEC.dat``)
:func:`read_collection`       every recording below a folder
:func:`manipulation`          the manipulation that a recording's name stands for
============================  =========================================================================
"""

from sec_lab.graphml.collection import manipulation, read_collection
from sec_lab.graphml.documents import read, read_chain, read_model, read_observation, write
from sec_lab.graphml.tables import read_table

__all__ = [
    "manipulation",
    "read",
    "read_chain",
    "read_collection",
    "read_model",
    "read_observation",
    "read_table",
    "write",
]
