"""Spatial relations of segments (step 2): scan lines (A.1), edges (§2.3), depth, time, and boxes in space (§4.2)."""

from sec_lab.relations.boxes import box_relations as box_relations
from sec_lab.relations.counts import MAX_SEGMENTS as MAX_SEGMENTS
from sec_lab.relations.counts import ScanLineCounts as ScanLineCounts
from sec_lab.relations.counts import line_sequences as line_sequences
from sec_lab.relations.counts import scan_lines as scan_lines
from sec_lab.relations.counts import sequence_counts as sequence_counts
from sec_lab.relations.depth import CONTACT_STEP_M as CONTACT_STEP_M
from sec_lab.relations.depth import DepthSteps as DepthSteps
from sec_lab.relations.depth import depth_steps as depth_steps
from sec_lab.relations.depth import overlap_kind as overlap_kind
from sec_lab.relations.depth import relations_by_depth as relations_by_depth
from sec_lab.relations.edges import edge_count_relations as edge_count_relations
from sec_lab.relations.edges import edge_counting as edge_counting
from sec_lab.relations.over_time import SeenFrame as SeenFrame
from sec_lab.relations.over_time import steady_relations as steady_relations
from sec_lab.relations.record import SegmentRelations as SegmentRelations
from sec_lab.relations.thresholds import OVERLAPPING_THRESHOLD as OVERLAPPING_THRESHOLD
from sec_lab.relations.thresholds import TOUCHING_THRESHOLD as TOUCHING_THRESHOLD
from sec_lab.relations.thresholds import Normalization as Normalization
from sec_lab.relations.thresholds import normalized_counts as normalized_counts
from sec_lab.relations.thresholds import relations_from_counts as relations_from_counts
from sec_lab.relations.thresholds import scan_line_relations as scan_line_relations
from sec_lab.relations.time_parameters import PICTURE_ALONE as PICTURE_ALONE
from sec_lab.relations.time_parameters import TimeParameters as TimeParameters
from sec_lab.relations.time_parameters import at_frame_rate as at_frame_rate
