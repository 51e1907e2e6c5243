"""Figures of everything in the workbench; no other room needs them.

Functions draw into axes that are given, or make a figure of their own, without pyplot; what they return shows itself in
a notebook. One style (:mod:`sec_lab.viz.style`) serves all of them.
"""

from sec_lab.viz.anchors import draw_anchor_spread as draw_anchor_spread
from sec_lab.viz.anchors import draw_demonstrated as draw_demonstrated
from sec_lab.viz.anchors import draw_planned as draw_planned
from sec_lab.viz.anchors import draw_prime_mover as draw_prime_mover
from sec_lab.viz.anchors import picture_axes as picture_axes
from sec_lab.viz.arm import ArmRecording as ArmRecording
from sec_lab.viz.arm import LiveArm as LiveArm
from sec_lab.viz.arm import arm_recording as arm_recording
from sec_lab.viz.by_model import draw_by_model as draw_by_model
from sec_lab.viz.by_model import draw_over_time as draw_over_time
from sec_lab.viz.cells import relation_name as relation_name
from sec_lab.viz.chain import chain_forms as chain_forms
from sec_lab.viz.chain import draw_chain as draw_chain
from sec_lab.viz.counts import draw_counts as draw_counts
from sec_lab.viz.curves import draw_curves as draw_curves
from sec_lab.viz.dots import draw_intervals as draw_intervals
from sec_lab.viz.dots import draw_spread as draw_spread
from sec_lab.viz.gallery import Panel as Panel
from sec_lab.viz.gallery import draw_gallery as draw_gallery
from sec_lab.viz.gallery import graph_at as graph_at
from sec_lab.viz.graph_3d import Page3D as Page3D
from sec_lab.viz.graph_3d import draw_graph_3d as draw_graph_3d
from sec_lab.viz.match import draw_match as draw_match
from sec_lab.viz.moments import draw_moments as draw_moments
from sec_lab.viz.noise import draw_levels as draw_levels
from sec_lab.viz.noise import draw_models as draw_models
from sec_lab.viz.noise import draw_network as draw_network
from sec_lab.viz.noise import draw_noisy_sample as draw_noisy_sample
from sec_lab.viz.noise import draw_positives as draw_positives
from sec_lab.viz.noise import draw_precision_recall as draw_precision_recall
from sec_lab.viz.roles import RoleStrip as RoleStrip
from sec_lab.viz.roles import draw_roles as draw_roles
from sec_lab.viz.scene import draw_segments as draw_segments
from sec_lab.viz.strip import draw_main_graphs as draw_main_graphs
from sec_lab.viz.style import new_figure as new_figure
from sec_lab.viz.table import draw_similarity_table as draw_similarity_table
from sec_lab.viz.timeline import draw_events as draw_events
from sec_lab.viz.verdicts import Finding as Finding
from sec_lab.viz.verdicts import verdict_table as verdict_table
from sec_lab.viz.watched import colour_labels as colour_labels
from sec_lab.viz.watched import draw_seen as draw_seen
from sec_lab.viz.watched import draw_strips as draw_strips
from sec_lab.viz.watched import frames_at as frames_at
from sec_lab.viz.watched import start_of_last_attempt as start_of_last_attempt
