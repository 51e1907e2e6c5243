"""Relation codes and the thesis's encodings of them; the expected symbols are those that the thesis prints."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sec_lab.codes import (
    LETTER_OF,
    WORD_OF,
    Relation,
    as_array,
    as_integers,
    as_relations,
    from_binary,
    from_letters,
    from_words,
    to_binary,
    to_letters,
)

CODES = st.sampled_from([0, 1, 2, 9])


def test_codes_of_the_thesis() -> None:
    """§2.3: Touching = 2, Overlapping = 1, Non-touching = 0, Absent = 9."""
    assert {relation.name: int(relation) for relation in Relation} == {
        "TOUCHING": 2,
        "OVERLAPPING": 1,
        "NON_TOUCHING": 0,
        "ABSENT": 9,
    }


class TestWords:
    def test_words_of_the_dialect(self) -> None:
        words = ["Touching", "Overlapping", "NoConnection", "Absence"]
        assert from_words(words).tolist() == [2, 1, 0, 9]
        assert [WORD_OF[Relation(code)] for code in (2, 1, 0, 9)] == words

    def test_no_word(self) -> None:
        assert from_words([]).shape == (0,)

    @pytest.mark.parametrize(
        "words", [["touching"], ["Touching", ""], ["Touching", None], [["Touching"]], "Touching", [2]]
    )
    def test_unknown_word(self, words: object) -> None:
        with pytest.raises(ValueError, match="relations: expected NoConnection, Overlapping, Touching, Absence, got"):
            from_words(words)  # type: ignore[arg-type]


class TestLetters:
    def test_letters_of_pushing(self) -> None:
        """§2.10.1: N, T and A instead of 0, 2 and 9; overlapping is another view of touching."""
        assert from_letters("NTA").tolist() == [0, 2, 9]
        assert from_letters(["N", "T", "A"]).tolist() == [0, 2, 9]
        assert to_letters([0, 1, 2, 9]) == "NTTA"
        assert set(LETTER_OF.values()) == {"N", "T", "A"}

    @given(st.text("NTA"))
    def test_there_and_back(self, letters: str) -> None:
        assert to_letters(from_letters(letters)) == letters

    @given(st.lists(CODES))
    def test_overlapping_becomes_touching(self, codes: list[int]) -> None:
        assert from_letters(to_letters(codes)).tolist() == [2 if code == 1 else code for code in codes]

    @pytest.mark.parametrize("letters", ["NXA", "nta", " N", ["NT"], [["N"], ["T"]], [0]])
    def test_unknown_letter(self, letters: object) -> None:
        with pytest.raises(ValueError, match="relations: expected N, T, A, got"):
            from_letters(letters)  # type: ignore[arg-type]

    def test_one_row_at_a_time(self) -> None:
        with pytest.raises(ValueError, match="relations: expected 1 dimensions"):
            to_letters([[0, 2], [2, 0]])


class TestBinary:
    def test_tables_of_labex(self) -> None:
        """§4.2.1: 1 stands for touching, 0 for non-touching."""
        table = from_binary([[0, 1], [9, 1]])
        assert table.tolist() == [[0, 2], [9, 2]]
        assert table.dtype == np.uint8
        assert to_binary(table).tolist() == [[0, 1], [9, 1]]

    @given(st.lists(CODES))
    def test_overlapping_becomes_touching(self, codes: list[int]) -> None:
        assert to_binary(codes).tolist() == [1 if code in (1, 2) else code for code in codes]
        assert from_binary(to_binary(codes)).tolist() == [2 if code == 1 else code for code in codes]

    def test_truth_values(self) -> None:
        assert from_binary([[False, True]]).tolist() == [[0, 2]]

    @pytest.mark.parametrize(
        ("table", "message"),
        [
            ([0, 2], "0/1 table: expected 0, 1 or 9, got 2"),
            ([0, -1], "0/1 table: expected 0, 1 or 9, got -1"),
            ([0, 0.5], "0/1 table: expected whole numbers, got 0.5"),
            ([0, np.nan], "0/1 table: expected whole numbers, got nan"),
            ([[0, 1], [0]], "0/1 table: .* ragged rows"),
            ("01", "0/1 table: expected numbers"),
        ],
    )
    def test_bad_table(self, table: object, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            from_binary(table)  # type: ignore[arg-type]


class TestArrays:
    @pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.int64, np.float32, np.float64, ">i4"])
    def test_every_type_of_number(self, dtype: str) -> None:
        codes = as_relations(np.array([[0, 1], [2, 9]], dtype=dtype))
        assert codes.dtype == np.uint8
        assert codes.tolist() == [[0, 1], [2, 9]]

    @pytest.mark.parametrize("convert", [as_relations, lambda values: as_integers(values, what="labels")])
    @pytest.mark.parametrize("dtype", [np.uint8, np.int64])
    def test_a_copy_is_returned(self, convert: object, dtype: type) -> None:
        given_array: NDArray[np.integer] = np.array([0, 2], dtype=dtype)
        copied = convert(given_array)  # type: ignore[operator]
        copied[0] = 1
        assert given_array.tolist() == [0, 2]

    def test_largest_whole_numbers(self) -> None:
        assert as_integers(np.array([2**63 - 1], np.uint64), what="labels").tolist() == [2**63 - 1]
        assert as_integers([-(2**63)], what="labels").tolist() == [-(2**63)]
        assert as_integers([2.0**53 - 1], what="labels").tolist() == [2**53 - 1]

    @given(st.integers(-300, 300))
    def test_no_number_becomes_another_code(self, number: int) -> None:
        if number in (0, 1, 2, 9):
            assert as_relations([number]).tolist() == [number]
        else:
            with pytest.raises(ValueError, match=f"relations: expected codes 0, 1, 2 or 9, got {number}$"):
                as_relations([number])

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ([1.5], "labels: expected whole numbers, got 1.5"),
            ([1, np.nan], "labels: expected whole numbers, got nan"),
            ([np.inf], "labels: expected whole numbers, got inf"),
            ([2.0**53], "labels: expected whole numbers"),  # from here on doubles skip whole numbers
            ([2**63], r"labels: expected numbers below 2\*\*63, got 9223372036854775808"),
            ([2**70], "labels: expected numbers, got values of type object"),
            ([[1, 2], [3]], "labels: expected a rectangular array of numbers, got ragged rows"),
            (["1"], "labels: expected numbers"),
            ([None], "labels: expected numbers"),
            ([1 + 2j], "labels: expected numbers"),
            (np.array(["2020-01-01"], dtype="datetime64[D]"), "labels: expected numbers"),
        ],
    )
    def test_bad_whole_numbers(self, values: object, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            as_integers(values, what="labels")  # type: ignore[arg-type]

    def test_dimensions(self) -> None:
        assert as_array([[0.5]], what="positions", ndim=2).tolist() == [[0.5]]
        with pytest.raises(ValueError, match=r"positions: expected 2 dimensions, got shape \(1,\)"):
            as_array([0.5], what="positions", ndim=2)
        with pytest.raises(ValueError, match=r"relations: expected 2 dimensions, got shape \(\)"):
            as_relations(2, ndim=2)
