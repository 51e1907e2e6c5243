"""Roles of hand and things in a recording, found without models of things (beyond the thesis).

=============================  ======================================================================
:func:`role_table`             a recording → the rows between hand, object 1, object 2, object 3, partner
:func:`find_hand`              the hand, by when it is there and how far it moves
:class:`Cleaning`              what is cleaned before; its steps are functions of ``cleaning``
:func:`role_similarity`        two role tables → similarity in percent
:func:`role_similarity_table`  all of them with each other
:func:`in_words`               a role table, told
:func:`played_by`              who plays each role in many recordings
=============================  ======================================================================
"""

from sec_lab.role_tables.cleaning import (
    NO_CLEANING,
    STEPS,
    Cleaning,
    bridge_absences,
    clean,
    cleanings_one_by_one,
    cleanings_step_by_step,
    drop_short_lived,
    drop_untouched,
    merge_moving_together,
    merge_with_hand,
)
from sec_lab.role_tables.hand import Hand, find_hand
from sec_lab.role_tables.history import SegmentHistory, segment_history
from sec_lab.role_tables.similarity import Compressed, role_similarity, role_similarity_table
from sec_lab.role_tables.table import ROLES, ROWS, RoleTable, role_table
from sec_lab.role_tables.words import in_words, played_by

__all__ = [
    "Cleaning",
    "Compressed",
    "Hand",
    "NO_CLEANING",
    "ROLES",
    "ROWS",
    "STEPS",
    "RoleTable",
    "SegmentHistory",
    "bridge_absences",
    "clean",
    "cleanings_one_by_one",
    "cleanings_step_by_step",
    "drop_short_lived",
    "drop_untouched",
    "find_hand",
    "in_words",
    "merge_moving_together",
    "merge_with_hand",
    "played_by",
    "role_similarity",
    "role_similarity_table",
    "role_table",
    "segment_history",
]
