import os
from functools import partial
from pathlib import Path

import pytest

from sec_lab.files import UnusableFileError, read_whole, write_whole, written_together


def refused(path: str | Path, reason: str, *, write: bool = False, max_bytes: int = 100) -> None:
    """The error is one line that begins with the path, and either way of catching bad input finds it."""
    use = (
        partial(write_whole, path, "new")
        if write
        else partial(read_whole, path, expected="a chain", max_bytes=max_bytes)
    )
    for caught in (ValueError, OSError):
        with pytest.raises(caught) as raised:
            use()
        assert type(raised.value) is UnusableFileError
        assert str(raised.value) == f"{path}: {reason}"


class TestRead:
    def test_whole_content(self, tmp_path: Path) -> None:
        file = tmp_path / "chain.csv"
        file.write_bytes(b"a,b\r\n\0\xff")
        assert read_whole(file, expected="a chain") == b"a,b\r\n\0\xff"
        assert read_whole(str(file), expected="a chain") == b"a,b\r\n\0\xff"

    def test_empty_file(self, tmp_path: Path) -> None:
        (tmp_path / "empty").touch()
        assert read_whole(tmp_path / "empty", expected="a chain") == b""

    def test_missing(self, tmp_path: Path) -> None:
        refused(tmp_path / "no", "expected a chain, but there is no such file")
        refused(tmp_path / "no" / "such", "expected a chain, but there is no such file")

    def test_file_where_a_folder_should_be(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        refused(tmp_path / "file" / "chain", "expected a chain, but there is no such file")

    def test_link_to_nothing(self, tmp_path: Path) -> None:
        (tmp_path / "link").symlink_to(tmp_path / "gone")
        refused(tmp_path / "link", "expected a chain, but there is no such file")

    def test_folder(self, tmp_path: Path) -> None:
        refused(tmp_path, "expected a chain, but this is a directory")
        with pytest.raises(UnusableFileError, match="expected a chain, but this is a directory"):
            read_whole("", expected="a chain")

    def test_link_to_itself(self, tmp_path: Path) -> None:
        (tmp_path / "loop").symlink_to(tmp_path / "loop")
        refused(tmp_path / "loop", "expected a chain, but it cannot be read (Too many levels of symbolic links)")

    def test_name_that_no_file_can_have(self) -> None:
        refused("x" * 300, "expected a chain, but it cannot be read (File name too long)")
        refused("a\0b", "expected a chain, but it cannot be read (embedded null byte)")

    @pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
    def test_no_permission(self, tmp_path: Path) -> None:
        file = tmp_path / "secret"
        file.touch(mode=0)
        refused(file, "expected a chain, but it cannot be read (Permission denied)")

    def test_reading_fails_half_way(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(path: Path, mode: str) -> object:
            raise OSError(5, "Input/output error")

        monkeypatch.setattr(Path, "open", fail)
        refused(tmp_path / "chain", "expected a chain, but it cannot be read (Input/output error)")

    def test_size(self, tmp_path: Path) -> None:
        file = tmp_path / "chain"
        file.write_bytes(b"12345")
        assert read_whole(file, expected="a chain", max_bytes=5) == b"12345"
        refused(file, "expected a chain of at most 4 bytes, but it is larger", max_bytes=4)


class TestWrite:
    def test_text_and_bytes(self, tmp_path: Path) -> None:
        file = tmp_path / "chain"
        write_whole(file, "ξ_o\n")
        assert file.read_bytes() == b"\xce\xbe_o\n"
        write_whole(str(file), b"\r\n\xff")
        assert file.read_bytes() == b"\r\n\xff"
        assert list(tmp_path.iterdir()) == [file]

    def test_name_of_the_greatest_length(self, tmp_path: Path) -> None:
        file = tmp_path / ("ξ" * 127)  # 254 bytes of 255
        write_whole(file, "a")
        assert list(tmp_path.iterdir()) == [file]

    def test_missing_folder(self, tmp_path: Path) -> None:
        folder = tmp_path / "no" / "such"
        refused(folder / "chain", f"cannot be written, there is no folder {folder}", write=True)
        (tmp_path / "file").touch()
        refused(tmp_path / "file" / "chain", f"cannot be written, there is no folder {tmp_path / 'file'}", write=True)
        assert [path.name for path in tmp_path.iterdir()] == ["file"]

    def test_folder(self, tmp_path: Path) -> None:
        (tmp_path / "folder").mkdir()
        refused(tmp_path / "folder", "cannot be written, this is a directory", write=True)
        assert [path.name for path in tmp_path.iterdir()] == ["folder"]
        for path in (".", "", ".."):
            with pytest.raises(UnusableFileError, match="cannot be written, this is a directory"):
                write_whole(path, "new")

    def test_name_that_no_file_can_have(self, tmp_path: Path) -> None:
        refused(tmp_path / ("x" * 300), "cannot be written (File name too long)", write=True)
        refused(tmp_path / "a\0b", "cannot be written (embedded null byte)", write=True)
        assert list(tmp_path.iterdir()) == []

    def test_text_that_is_no_text(self, tmp_path: Path) -> None:
        file = tmp_path / "chain"
        file.write_text("old")
        with pytest.raises(UnusableFileError, match=r"chain: cannot be written .*surrogates not allowed"):
            write_whole(file, "a\udc80")
        assert file.read_text() == "old"

    @pytest.mark.parametrize("step", ["fsync", "replace"])
    def test_full_disk_leaves_the_old_file(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str) -> None:
        file = tmp_path / "chain"
        file.write_text("old")

        def fail(*_: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(*((os, step) if step == "fsync" else (Path, step)), fail)
        refused(file, "cannot be written (No space left on device)", write=True)
        assert file.read_text() == "old"
        assert list(tmp_path.iterdir()) == [file]

    def test_interruption_leaves_the_old_file(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        file = tmp_path / "chain"
        file.write_text("old")

        def interrupt(_: int) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(os, "fsync", interrupt)
        with pytest.raises(KeyboardInterrupt):
            write_whole(file, "new")
        assert file.read_text() == "old"
        assert list(tmp_path.iterdir()) == [file]


class TestWrittenTogether:
    def test_all_take_their_places_at_the_end(self, tmp_path: Path) -> None:
        places = [tmp_path / "a.mp4", tmp_path / "b.html"]
        places[1].write_text("old")
        with written_together(places) as made:
            assert [path.suffix for path in made] == [".mp4", ".html"]
            for path in made:
                path.write_text("new")
            assert [place.exists() for place in places] == [False, True]
            assert places[1].read_text() == "old"
        assert sorted(tmp_path.iterdir()) == places
        assert [place.read_text() for place in places] == ["new", "new"]

    @pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, UnusableFileError])
    def test_nothing_is_left_of_an_error(self, tmp_path: Path, error: type[BaseException]) -> None:
        (tmp_path / "a").write_text("old")

        def fail() -> None:
            with written_together([tmp_path / "a", tmp_path / "b"]) as made:
                for path in made:
                    path.write_text("new")
                raise error

        with pytest.raises(error):
            fail()
        assert sorted(tmp_path.iterdir()) == [tmp_path / "a"]
        assert (tmp_path / "a").read_text() == "old"

    def test_errors_name_the_places_that_were_asked_for(self, tmp_path: Path) -> None:
        with (
            pytest.raises(UnusableFileError, match=r"/a\.mp4: cannot be written"),
            written_together([tmp_path / "a.mp4"]) as (made,),
        ):
            raise UnusableFileError(f"{made}: cannot be written")

    def test_a_file_that_was_not_made_is_an_error(self, tmp_path: Path) -> None:
        with pytest.raises(UnusableFileError, match="a"), written_together([tmp_path / "a"]):
            pass

    def test_places_that_cannot_be_used(self, tmp_path: Path) -> None:
        for paths, reason in (
            ([tmp_path / "no" / "a"], "there is no folder"),
            ([tmp_path], "this is a directory"),
            ([tmp_path / "a", tmp_path / "." / "a"], "expected every file once"),
        ):
            with pytest.raises(UnusableFileError, match=reason), written_together(paths):
                raise AssertionError("entered")
