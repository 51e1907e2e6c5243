from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest

from sec_lab import similarity
from sec_lab.event_chain import EventChain
from sec_lab.similarity import Match, compare, pairwise_similarity, permutations, similarity_table
from tests.naive_similarity import (
    Table,
    all_permutations_similarity,
    compressed,
    naive_changing_rows,
    naive_compare,
    naive_row_similarity,
    ordered_sum,
)

# ξ_o of the two artificial samples (Fig. 2.5 (d), 2.6 (d)); ρ_{3,2} of the first never changes.
FIRST = EventChain(
    [[1, 2, 1, 1, 1], [1, 1, 1, 2, 1], [0, 2, 1, 2, 0], [0, 0, 0, 0, 0], [1, 2, 0, 0, 0], [0, 0, 0, 2, 1]],
    [(2, 1), (3, 1), (4, 1), (3, 2), (4, 2), (4, 3)],
)
SECOND = EventChain(
    [[1, 1, 1, 2, 1], [0, 2, 1, 2, 0], [1, 2, 1, 1, 1], [0, 0, 0, 2, 1], [1, 2, 0, 0, 0]],
    [(2, 1), (3, 1), (6, 1), (3, 2), (3, 6)],
)

STILL = EventChain([[0, 0, 0]], [(1, 2)])
SINGLE = EventChain([[0], [2]], [(1, 2), (2, 3)])


def chain_of(table: Table) -> EventChain:
    return EventChain(table, [(i + 2, 1) for i in range(len(table))])


def random_table(rng: np.random.Generator, n_rows: int, n_columns: int, codes: tuple[int, ...] = (0, 1, 2, 9)) -> Table:
    """Random relations; every row changes."""
    table = rng.choice(codes, (n_rows, n_columns))
    still = (table == table[:, :1]).all(axis=1)
    table[still, -1] = np.where(table[still, 0] == codes[0], codes[1], codes[0])
    return table.tolist()


def correspondences(rows: np.ndarray) -> dict[tuple[int, int], tuple[int, int]]:
    return {tuple(FIRST.pairs[i].tolist()): tuple(SECOND.pairs[j].tolist()) for i, j in rows}


class TestWorkedExample:
    """Chapter 2: *Moving Object* in two versions."""

    def test_table_2_1(self) -> None:
        frame = compare(FIRST, SECOND).row_similarity_frame()
        assert frame.index.tolist() == ["2, 1", "3, 1", "4, 1", "4, 2", "4, 3"]
        assert frame.columns.tolist() == ["2, 1", "3, 1", "6, 1", "3, 2", "3, 6"]
        assert frame.to_numpy().tolist() == [
            [100, 25, 100, 50, 50],
            [100, 25, 100, 50, 50],
            [25, 100, 25, 50, 50],
            [50, 50, 50, 0, 100],
            [50, 50, 50, 100, 0],
        ]

    def test_table_2_2(self) -> None:
        rest = {(4, 1): (3, 1), (4, 2): (3, 6), (4, 3): (3, 2)}
        both = {one.temporal: correspondences(one.rows) for one in permutations(compare(FIRST, SECOND))}
        assert both == {
            84: {(2, 1): (2, 1), (3, 1): (6, 1), **rest},
            100: {(2, 1): (6, 1), (3, 1): (2, 1), **rest},
        }

    def test_similarities(self) -> None:
        match = compare(FIRST, SECOND)
        assert (match.spatial, match.temporal, match.exact) == (100, 100, True)
        assert match.rows.tolist() == [[0, 2], [1, 0], [2, 1], [4, 4], [5, 3]]
        assert match.columns.tolist() == [[i, i] for i in range(5)]

    def test_the_naive_twin_agrees_with_the_thesis(self) -> None:
        naive = naive_compare(FIRST.relations.tolist(), SECOND.relations.tolist(), partial=False)
        assert (naive.spatial, naive.temporal, naive.n_assignments) == (100, 100, 2)
        assert naive.best == [((0, 2), (1, 0), (2, 1), (3, 4), (4, 3))]

    def test_all_permutations(self) -> None:
        tried = all_permutations_similarity(FIRST.relations.tolist(), SECOND.relations.tolist())
        assert tried == (100, 120)


class TestReadings:
    """What the text leaves open, on chains small enough for the head."""

    there_and_back = EventChain([[0, 2, 0], [0, 2, 2]], [(1, 2), (2, 3)])
    only_back = EventChain([[0, 2, 0]], [(1, 2)])

    def test_a_row_counts_only_where_its_maximum_is_also_that_of_the_column(self) -> None:
        # Row 02 reaches 50 % in a column whose best is 100 %, so it adds nothing.
        assert compare(self.there_and_back, self.only_back).row_similarity.tolist() == [[100], [50]]
        assert compare(self.there_and_back, self.only_back).spatial == 50
        assert compare(self.only_back, self.there_and_back).spatial == 100

    @pytest.mark.parametrize(("tolerance", "spatial"), [(0, 50), (49.9, 50), (50, 75), (100, 75)])
    def test_the_tolerance_lets_it_count(self, tolerance: float, spatial: float) -> None:
        assert compare(self.there_and_back, self.only_back, tolerance_percent=tolerance).spatial == spatial

    @pytest.mark.parametrize(("tolerance", "both"), [(49.999, False), (50, True)])
    def test_rounding_does_not_decide_what_lies_within_the_tolerance(self, tolerance: float, both: bool) -> None:
        # 2 of 3 and 1 of 6 changes agree: 200/3 − 50 is 50/3, but not in floating point.
        assert 100 / 6 < 200 / 3 - 50
        a = EventChain([[0, 2, 0, 1]], [(1, 2)])
        b = EventChain([[0, 2, 0, 2, 2, 2, 2], [9, 1, 9, 1, 9, 0, 1]], [(1, 2), (2, 3)])
        match = compare(a, b, tolerance_percent=tolerance)
        assert match.row_similarity.tolist() == [[pytest.approx(200 / 3), pytest.approx(50 / 3)]]
        assert match.candidates.tolist() == [[True, both]]

    def test_the_shorter_row_may_divide(self) -> None:
        assert compare(self.there_and_back, self.only_back, normalizer="shorter").row_similarity.tolist() == [
            [100],
            [100],
        ]

    def test_rows_without_a_partner_lower_the_similarity_and_surplus_rows_do_not(self) -> None:
        assert compare(self.there_and_back, self.only_back).temporal == 50
        assert compare(self.only_back, self.there_and_back).temporal == 100

    def test_the_smaller_number_of_columns_divides(self) -> None:
        longer = EventChain([[0, 0, 2, 2, 0]], [(1, 2)])
        assert compare(self.only_back, longer).temporal == 100
        assert compare(longer, self.only_back).temporal == 100

    def test_columns_agree_in_part_and_keep_their_order(self) -> None:
        # Columns 02, 20 and 20, 02: pairing the equal ones crosswise would give 100 %, one pair of them gives 2 of 4.
        a = EventChain([[0, 2], [2, 0]], [(1, 2), (2, 3)])
        assert compare(a, a).temporal == 100
        late = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)])
        swapped = EventChain([[0, 0, 2], [0, 2, 2]], [(1, 2), (3, 2)])
        both = [one.temporal for one in permutations(compare(late, swapped))]
        # The identity agrees in columns 0 and 2 fully and in no entry of column 1: 4 of 6.
        assert sorted(both) == [pytest.approx(200 / 3), 100]

    def test_rows_without_any_similarity_do_not_correspond(self) -> None:
        match = compare(EventChain([[0, 2]], [(1, 2)]), EventChain([[2, 0]], [(1, 2)]), tolerance_percent=100)
        assert (match.spatial, match.temporal, match.exact) == (0, 0, True)
        assert match.rows.shape == match.columns.shape == (0, 2)
        assert [one.temporal for one in permutations(match)] == [0]

    def test_derived_chains_have_a_column_less(self) -> None:
        # 00, 02, 22 and 02, 22, 22: 02 and 22 in their order, 2 of 3. The original chains agree in 3 of 4.
        a, b = EventChain([[0, 0, 2, 2]], [(1, 2)]), EventChain([[0, 2, 2, 2]], [(1, 2)])
        assert compare(a, b, temporal_input="derived").temporal == pytest.approx(200 / 3)
        assert compare(a, b, temporal_input="derived").columns[0].tolist() == [1, 0]
        assert compare(a, b).temporal == 75

    def test_rows_that_never_change_do_not_count(self) -> None:
        table = [[2, 2, 2], *self.there_and_back.relations.tolist()]
        match = compare(chain_of(table), self.there_and_back)
        assert (match.spatial, match.temporal) == (100, 100)
        assert match.rows.tolist() == [[1, 0], [2, 1]]


class TestSizes:
    """Where the packing of columns, rows and symbols begins anew."""

    @pytest.mark.parametrize("temporal_input", ["original", "derived"])
    @pytest.mark.parametrize("u", range(2, 11))
    def test_few_columns(self, u: int, temporal_input: str) -> None:
        rng = np.random.default_rng(u)
        for v in range(2, 11):
            self.assert_as_naive(random_table(rng, 3, u, (0, 2)), random_table(rng, 3, v, (0, 2)), temporal_input)

    @pytest.mark.parametrize("temporal_input", ["original", "derived"])
    @pytest.mark.parametrize(("u", "v"), [(64, 65), (65, 64), (66, 66), (64, 3), (5, 65)])
    def test_many_columns(self, u: int, v: int, temporal_input: str) -> None:
        rng = np.random.default_rng(7)
        self.assert_as_naive(random_table(rng, 2, u), random_table(rng, 3, v), temporal_input)

    def test_many_changes_in_a_row(self) -> None:
        # More changes than fit 4 bits each into one word.
        rng = np.random.default_rng(7)
        tables = [random_table(rng, 5, n, (0, 2)) for n in (17, 18, 34, 60)]
        for a in tables:
            for b in tables:
                for normalizer in ("longer", "shorter"):
                    found = compare(chain_of(a), chain_of(b), normalizer=normalizer).row_similarity  # type: ignore[arg-type]
                    expected = [
                        [float(naive_row_similarity(compressed(x), compressed(y), normalizer=normalizer)) for y in b]
                        for x in a
                    ]
                    np.testing.assert_allclose(found, expected, rtol=1e-12)

    def test_more_rows_than_a_byte_counts(self) -> None:
        early, late = [0, 2, 2], [0, 0, 2]
        a = chain_of([early] * 300)
        assert compare(a, a).temporal == 100
        # All rows correspond; columns 0 and 2 agree in all 300, column 1 in 200.
        match = compare(a, chain_of([early] * 200 + [late] * 100))
        assert len(match.rows) == 300
        assert match.temporal == pytest.approx(100 * 800 / 900)

    def test_more_rows_with_a_choice_than_a_byte_counts(self) -> None:
        early, late = [0, 2, 2], [0, 0, 2]
        halves = chain_of([early] * 150 + [late] * 150)
        shuffled = chain_of([early, late] * 150)
        match = compare(halves, shuffled)
        assert (match.spatial, match.temporal, match.exact) == (100, 100, True)
        assert sorted(match.rows[:, 1].tolist()) == list(range(300))
        # 50 rows have to change sides: each of them disagrees in column 1.
        fewer = compare(halves, chain_of([early] * 200 + [late] * 100))
        assert fewer.temporal == pytest.approx(100 * (900 - 50) / 900)

    def test_too_many_rows(self) -> None:
        table = np.zeros((65_536, 2), int)
        table[:, 1] = 2
        pairs = np.column_stack([np.zeros(65_536, int), np.arange(1, 65_537)])
        with pytest.raises(ValueError, match=r"^second chain: expected at most 65535 changing rows, got 65536$"):
            compare(FIRST, EventChain(table, pairs))

    def test_many_kinds_of_rows(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # Above a limit, similarities of kinds of rows are computed where they are needed instead of in a table.
        rng = np.random.default_rng(7)
        chains = [chain_of(random_table(rng, int(rng.integers(1, 7)), int(rng.integers(2, 9)))) for _ in range(12)]
        usual = pairwise_similarity(chains)
        monkeypatch.setattr(similarity, "_MAX_KINDS", 0)
        other = pairwise_similarity(chains)
        assert usual.temporal.tolist() == other.temporal.tolist()
        assert usual.spatial.tolist() == other.spatial.tolist()
        assert len(np.unique(usual.spatial)) > 10

    @staticmethod
    def assert_as_naive(a: Table, b: Table, temporal_input: str) -> None:
        # The tolerance lets every pair of rows that is similar at all correspond.
        match = compare(chain_of(a), chain_of(b), tolerance_percent=100, temporal_input=temporal_input)  # type: ignore[arg-type]
        naive = naive_compare(a, b, tolerance_percent=100, temporal_input=temporal_input, partial=False)
        assert match.exact
        assert match.temporal == pytest.approx(float(naive.temporal), rel=1e-12)
        assert match.spatial == pytest.approx(float(naive.spatial), rel=1e-12)


class TestLargeChains:
    """Chains with so many permutations that no proof is to be had."""

    def test_bounds_of_the_best_that_was_found(self) -> None:
        rng = np.random.default_rng(7)
        a = random_table(rng, 25, 57, (0, 2))
        flipped = np.where(rng.random((25, 57)) < 0.05, rng.choice((0, 2), (25, 57)), a).tolist()
        match = compare(chain_of(a), chain_of(flipped), tolerance_percent=20)
        assert match.candidates.sum() > 200
        candidates = match.candidates.tolist()
        in_place = sum(x == y for i in range(25) if candidates[i][i] for x, y in zip(a[i], flipped[i], strict=True))
        at_best = ordered_sum(
            [
                [
                    sum(any(a[i][x] == flipped[j][y] for j in range(25) if candidates[i][j]) for i in range(25))
                    for y in range(57)
                ]
                for x in range(57)
            ]
        )
        assert in_place > 0.5 * 25 * 57
        assert 100 * in_place / 25 / 57 <= match.temporal + 1e-9
        assert match.temporal <= 100 * at_best / 25 / 57 + 1e-9

    @pytest.mark.parametrize("effort", [1, 1000, 100_000])
    def test_itself(self, effort: int) -> None:
        chain = chain_of(random_table(np.random.default_rng(7), 25, 57))
        match = compare(chain, chain, tolerance_percent=20, effort=effort)
        assert (match.spatial, match.temporal, match.exact) == (100, 100, True)

    def test_unrelated_chains_come_to_an_end_without_a_proof(self) -> None:
        rng = np.random.default_rng(7)
        chains = [chain_of(random_table(rng, 25, 57)) for _ in range(2)]
        match = compare(*chains, tolerance_percent=20)
        assert not match.exact
        table = similarity_table(chains, tolerance_percent=20)
        assert table.attrs["exact_percent"] == 0
        assert table.loc[0, 1] == match.temporal
        with pytest.raises(ValueError, match=r"^permutations: expected at most 100, there are more$"):
            permutations(match, limit=100)

    def test_more_effort_finds_no_less(self) -> None:
        rng = np.random.default_rng(7)
        chains = [chain_of(random_table(rng, 8, 8, (0, 2))) for _ in range(2)]
        found = [compare(*chains, tolerance_percent=100, effort=effort) for effort in (1, 1000, 10**8)]
        assert found[0].temporal <= found[1].temporal <= found[2].temporal
        assert [match.exact for match in found] == [False, False, True]


class TestMatch:
    def test_arrays_are_write_protected(self) -> None:
        match = compare(FIRST, SECOND)
        for array in (match.rows, match.columns, match.row_similarity, match.candidates):
            with pytest.raises(ValueError, match="read-only"):
                array[0, 0] = 1

    def test_names_stand_in_the_table(self) -> None:
        named = EventChain([[0, 2]], [(1, 2)], names={1: "cup", 2: None})
        frame = compare(named, named).row_similarity_frame()
        assert frame.index.tolist() == frame.columns.tolist() == ["cup, 2"]

    def test_choices_are_kept(self) -> None:
        match = compare(FIRST, SECOND, normalizer="shorter", tolerance_percent=10, temporal_input="derived")
        assert isinstance(match, Match)
        assert (match.a, match.b) == (FIRST, SECOND)
        assert (match.normalizer, match.tolerance_percent, match.temporal_input) == ("shorter", 10, "derived")


class TestPermutations:
    def test_limit(self) -> None:
        match = compare(FIRST, SECOND)
        assert len(permutations(match, limit=2)) == 2
        with pytest.raises(ValueError, match=r"^permutations: expected at most 1, there are more$"):
            permutations(match, limit=1)

    def test_a_row_stays_alone_only_where_its_candidates_are_taken(self) -> None:
        a, b = chain_of([[0, 2, 2]] * 3), chain_of([[0, 2, 2]] * 2)
        found = [one.rows.tolist() for one in permutations(compare(a, b))]
        assert sorted(map(len, found)) == [2] * 6
        assert len({str(rows) for rows in found}) == 6


class TestTables:
    chains = {"moving": FIRST, "again": SECOND, "short": EventChain([[0, 2, 0]], [(1, 2)])}  # noqa: RUF012

    def test_names_and_what_it_says_of_itself(self) -> None:
        table = similarity_table(self.chains)
        assert table.index.tolist() == table.columns.tolist() == ["moving", "again", "short"]
        assert table.attrs == {"direction": "mean", "measure": "temporal", "exact_percent": 100}
        assert similarity_table(list(self.chains.values())).index.tolist() == [0, 1, 2]
        assert similarity_table(self.chains, measure="spatial", direction="larger").attrs == {
            "direction": "larger",
            "measure": "spatial",
        }

    def test_one_chain(self) -> None:
        table = similarity_table([FIRST])
        assert table.to_numpy().tolist() == [[100]]
        assert table.attrs["exact_percent"] == 100

    def test_a_measure_that_was_not_asked_for_is_left_out(self) -> None:
        only = pairwise_similarity(list(self.chains.values()), measures=["spatial"])
        assert (only.spatial.shape, only.temporal.shape, only.exact.shape) == ((3, 3), (0, 0), (0, 0))
        other = pairwise_similarity(list(self.chains.values()), measures=["temporal"])
        assert (other.spatial.shape, other.temporal.shape, other.exact.shape) == ((0, 0), (3, 3), (3, 3))

    def test_progress_is_shown_on_request_only(self, capsys: pytest.CaptureFixture[str]) -> None:
        quiet = similarity_table(self.chains)
        assert capsys.readouterr() == ("", "")
        shown = similarity_table(self.chains, progress=True)
        captured = capsys.readouterr()
        assert captured.out == ""
        assert "3/3" in captured.err
        assert shown.equals(quiet)

    def test_arrays_are_write_protected(self) -> None:
        result = pairwise_similarity([FIRST, SECOND])
        for array in (result.spatial, result.temporal, result.exact):
            with pytest.raises(ValueError, match="read-only"):
                array[0, 0] = 1

    def test_two_callers_at_once(self) -> None:
        rng = np.random.default_rng(7)
        groups = [[chain_of(random_table(rng, 5, 6)) for _ in range(40)] for _ in range(4)]
        one_by_one = [similarity_table(group) for group in groups]
        with ThreadPoolExecutor(2) as pool:
            at_once = list(pool.map(lambda group: similarity_table(group, n_threads=2), groups * 3))
        assert all(table.equals(expected) for table, expected in zip(at_once, one_by_one * 3, strict=True))
        assert not one_by_one[0].equals(one_by_one[1])


class TestBadInput:
    """One clear error each: what was expected, what came."""

    @pytest.mark.parametrize(
        ("chains", "message"),
        [
            ((SINGLE, FIRST), "first chain: expected an event chain of at least two columns, got one"),
            ((FIRST, SINGLE), "second chain: expected an event chain of at least two columns, got one"),
            ((STILL, FIRST), "first chain: expected an event chain with a change, but no row of it ever changes"),
            ((FIRST, STILL), "second chain: expected an event chain with a change, but no row of it ever changes"),
        ],
    )
    def test_chains(self, chains: tuple[EventChain, EventChain], message: str) -> None:
        with pytest.raises(ValueError, match=f"^{message}$"):
            compare(*chains)

    @pytest.mark.parametrize("bad", [SINGLE, STILL])
    def test_the_chain_is_named(self, bad: EventChain) -> None:
        with pytest.raises(ValueError, match=r"^chain 1: expected an event chain"):
            pairwise_similarity([FIRST, bad])
        with pytest.raises(ValueError, match=r"^chain 2: expected an event chain"):
            similarity_table([FIRST, SECOND, bad])
        with pytest.raises(ValueError, match=r"^chain pouring: expected an event chain"):
            similarity_table({"moving": FIRST, "pouring": bad})

    @pytest.mark.parametrize("call", [pairwise_similarity, similarity_table])
    def test_no_chain(self, call: Callable[[list[EventChain]], object]) -> None:
        with pytest.raises(ValueError, match=r"^chains: expected at least one event chain, got none$"):
            call([])

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"normalizer": "mean"}, "normalizer: expected .*'longer', 'shorter'.*got 'mean'"),
            ({"temporal_input": "compressed"}, "temporal_input: expected .*'original', 'derived'.*got 'compressed'"),
            ({"tolerance_percent": -1}, "tolerance_percent: expected 0 to 100, got -1"),
            ({"tolerance_percent": 100.5}, "tolerance_percent: expected 0 to 100, got 100.5"),
            ({"tolerance_percent": float("nan")}, "tolerance_percent: expected 0 to 100, got nan"),
            ({"tolerance_percent": float("inf")}, "tolerance_percent: expected 0 to 100, got inf"),
            ({"effort": 0}, "effort: expected at least 1, got 0"),
        ],
    )
    def test_options(self, options: dict[str, object], message: str) -> None:
        for call in (compare, lambda *chains, **kwargs: pairwise_similarity(chains, **kwargs)):
            with pytest.raises(ValueError, match=f"^{message}"):
                call(FIRST, SECOND, **options)
        with pytest.raises(ValueError, match=f"^{message}"):
            similarity_table([FIRST, SECOND], **options)  # type: ignore[arg-type]

    def test_options_of_tables(self) -> None:
        with pytest.raises(ValueError, match=r"^direction: expected one of .*'directed'.*got 'both'$"):
            similarity_table([FIRST], direction="both")  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=r"^measure: expected one of .*'spatial'.*got 'time'$"):
            similarity_table([FIRST], measure="time")  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=r"^measures: expected .*got 'time'$"):
            pairwise_similarity([FIRST], measures=["time"])  # type: ignore[list-item]


def test_the_naive_twin_counts_in_fractions() -> None:
    assert naive_row_similarity([12, 21], [12, 20, 12], normalizer="longer") == Fraction(100, 3)
    assert naive_row_similarity([12, 20, 12], [12, 21], normalizer="shorter") == 50
    assert naive_changing_rows([[1, 1], [1, 2]]) == [[1, 2]]
