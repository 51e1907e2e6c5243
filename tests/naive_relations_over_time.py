"""Slow, obvious reference of steady relations: the whole movie at hand, one dictionary a segment and a pair."""

from dataclasses import dataclass, field
from itertools import combinations

from sec_lab.relations import TimeParameters
from tests.naive_relations import naive_hints, naive_places

Image = list[list[int]]
Pair = tuple[int, int]
Found = tuple[list[int], dict[Pair, int]]


@dataclass
class _Segment:
    first: int
    rest_place: tuple[float, float]
    last: int = 0
    seen: int = 0
    largest: int = 0
    node: bool = False
    leaves: bool = False
    crumb: bool = False
    rests: int = 0
    has_moved: bool = False


@dataclass
class _Pair:
    state: int | None = None
    seen: list[int] = field(default_factory=list)  # codes, until the first state is decided
    contact_start: int = 0
    contact: list[int] = field(default_factory=list)  # codes that differ from the state in contact
    kind_start: int = 0
    kind: int = 0


def naive_steady(movie: list[Image], moving: list[set[int]], p: TimeParameters) -> list[Found]:
    """Segments and relations of every frame, without depth, with motion given, without joining of events."""
    memory = max(p.hysteresis_frames, p.min_life_frames) + 1
    lasting = max(1, p.hysteresis_frames)
    present: list[set[int]] = [set() for _ in movie]
    relations: list[dict[Pair, int]] = [{} for _ in movie]
    segments: dict[int, _Segment] = {}
    pairs: dict[Pair, _Pair] = {}

    def back(start: int, now: int) -> range:
        return range(max(start, now - memory + 1, 0), now + 1)

    def drop(label: int) -> None:
        del segments[label]
        for pair in [pair for pair in pairs if label in pair]:
            del pairs[pair]

    for now, image in enumerate(movie):
        places, hints = naive_places(image), naive_hints(image)
        area = {label: len(pixels) for label, pixels in places.items()}
        centre = {label: _centre(pixels) for label, pixels in places.items()}
        rests = {label: label not in moving[now] for label in places}
        for label in sorted(places):
            segment = segments.setdefault(label, _Segment(now, centre[label]))
            segment.largest = max(segment.largest, area[label])
            tiny = area[label] <= p.crumb_share * segment.largest
            segment.crumb = segment.leaves and not _at_border(places[label], image) and tiny
            rests[label] |= segment.crumb
        away, covered, hidden, pauses = {}, {}, {}, {}
        for label in sorted(places):
            segment = segments[label]
            distance = sum((a - b) ** 2 for a, b in zip(centre[label], segment.rest_place, strict=True))
            away[label] = distance * 3.141592653589793 > segment.largest
            covered[label] = any(hints.touching[label, other] for other in places if not rests[other])
            hidden[label] = area[label] < p.visible_share * segment.largest
            if rests[label] and not covered[label]:
                segment.rest_place = centre[label]
            at_border = _at_border(places[label], image)
            small = area[label] <= p.leaving_share * segment.largest
            segment.leaves = segment.crumb or (at_border and not rests[label] and small)
            segment.rests = segment.rests + 1 if rests[label] else 0
            segment.has_moved = segment.has_moved or not rests[label]
            short = rests[label] and segment.rests < p.pause_frames
            pauses[label] = at_border and segment.has_moved and short
        touching = {pair: _touching(hints, pair) for pair in combinations(sorted(places), 2)}
        ground = max(sorted(places), key=lambda label: area[label])
        sure = {
            (i, j): not (hidden[i] or hidden[j] or (j == ground and pauses[i]) or (i == ground and pauses[j]))
            for i, j in touching
        }
        counted = dict(touching)
        if p.contact_by_motion:
            counted.update({pair: 0.0 for pair in touching if rests[pair[0]] != rests[pair[1]]})
        for label in sorted(places):
            if not (p.carried and away[label] and not rests[label]):
                continue
            sure.update({pair: True for pair in touching if label in pair})
            carriers = [
                (hints.touching[label, other], -other)
                for other in places
                if not rests[other] and area[other] > area[label] and hints.touching[label, other]
            ]
            if carriers:
                pair = _ordered(label, -max(carriers)[1])
                counted[pair] = touching[pair]

        for label, segment in list(segments.items()):
            if label in places and not segment.crumb:
                segment.last = now
                segment.seen += 1
                if not segment.node and segment.seen >= p.min_life_frames:
                    segment.node = True
                    for frame in back(segment.first, now):
                        present[frame].add(label)
                if segment.node:
                    present[now].add(label)
                continue
            gap = now - segment.last
            if not segment.node:
                if gap > p.min_life_frames:
                    drop(label)
            elif gap >= lasting and (segment.leaves or p.hold_frames <= lasting):
                for frame in back(segment.last + 1, now):
                    present[frame].discard(label)
                drop(label)
            elif gap >= p.hold_frames:
                drop(label)
            else:
                present[now].add(label)

        for pair in combinations(sorted(segments), 2):
            pairs.setdefault(pair, _Pair())
        for pair in touching:
            if not sure[pair]:
                continue
            i, j = pair
            known = pairs[pair]
            rest = min(segments[i].rests, segments[j].rests)
            calm = not p.kind_at_rest or (rest > 0 and not _covered_smaller(area, covered, pair))
            code = _code(known.state, counted[pair], _overlapping(hints, pair), p)
            if code == 1 and known.state != 1 and not calm:
                code = 2
            if known.state is None:
                known.seen.append(code)
                if len(known.seen) >= lasting:
                    _settle(known, _most(known.seen))
                    for frame in back(max(segments[i].first, segments[j].first), now):
                        relations[frame][pair] = known.state or 0
                continue
            if p.freeze and rest >= p.hysteresis_frames and _covered_smaller(area, covered, pair):
                _settle(known, known.state)
                continue
            if (code > 0) != (known.state > 0):
                if not known.contact or now - known.contact_start >= memory:
                    known.contact_start, known.contact = now, []
                known.contact.append(code)
                if len(known.contact) >= lasting:
                    start = known.contact_start
                    _settle(known, 0 if code == 0 else 1 if known.contact.count(1) > known.contact.count(2) else 2)
                    for frame in back(start, now):
                        relations[frame][pair] = known.state or 0
                continue
            known.contact = []
            if not calm:
                continue
            if code == known.state:
                known.kind = 0
                continue
            if not known.kind or now - known.kind_start >= memory:
                known.kind_start, known.kind = now, 0
            known.kind += 1
            if known.kind >= lasting:
                start = known.kind_start
                _settle(known, code)
                for frame in back(start, now):
                    relations[frame][pair] = code
        for pair, known in pairs.items():
            relations[now][pair] = _most(known.seen) if known.state is None else known.state

    if len(movie) < p.min_life_frames:
        for label, segment in segments.items():
            if segment.first == 0 and not segment.node:
                for frame in range(segment.last + 1):
                    present[frame].add(label)
    return [
        (sorted(nodes), {pair: relations[frame].get(pair, 0) for pair in combinations(sorted(nodes), 2)})
        for frame, nodes in enumerate(present)
    ]


def _at_border(pixels: list[tuple[int, int]], image: Image) -> bool:
    return any(column in (0, len(image[0]) - 1) or row in (0, len(image) - 1) for column, row in pixels)


def _centre(pixels: list[tuple[int, int]]) -> tuple[float, float]:
    return sum(column for column, _ in pixels) / len(pixels), sum(row for _, row in pixels) / len(pixels)


def _ordered(i: int, j: int) -> Pair:
    return (i, j) if i < j else (j, i)


def _covered_smaller(area: dict[int, int], covered: dict[int, bool], pair: Pair) -> bool:
    i, j = pair
    return covered[j] if area[j] < area[i] else covered[i]


def _touching(hints: object, pair: Pair) -> float:
    return hints.touching[pair] / (2 * min(hints.lines[pair[0]], hints.lines[pair[1]]))  # type: ignore[attr-defined]


def _overlapping(hints: object, pair: Pair) -> float:
    i, j = pair
    surrounds = max(hints.overlapping[i, j], hints.overlapping[j, i])  # type: ignore[attr-defined]
    return float(surrounds / min(hints.lines[i], hints.lines[j]))  # type: ignore[attr-defined]


def _code(state: int | None, touching: float, overlapping: float, p: TimeParameters) -> int:
    def needed(thresholds: tuple[float, float], *, holds: bool) -> float:
        return 0.5 * (thresholds[0] + thresholds[1]) if state is None else thresholds[0 if holds else 1]

    if touching <= needed(p.touching_thresholds, holds=state in (1, 2)):
        return 0
    return 1 if overlapping > needed(p.overlapping_thresholds, holds=state == 1) else 2


def _most(codes: list[int]) -> int:
    contact = [code for code in codes if code]
    if not contact or len(contact) < codes.count(0):
        return 0
    return 1 if contact.count(1) > contact.count(2) else 2


def _settle(known: _Pair, state: int | None) -> None:
    known.state, known.seen, known.contact, known.kind = state, [], [], 0
