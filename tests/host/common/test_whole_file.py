"""Files appear whole or not at all; pipes and devices are written to directly."""

import os
from pathlib import Path

import pytest

from steptwin.host.common.own_files import growing_file
from steptwin.host.common.whole_file import append, whole_file
from tests.messages import refusing


def write(path: Path, data: bytes = b"new", broken_off_by: BaseException | None = None) -> None:
    with whole_file(path) as file:
        file.write(data)
        if broken_off_by:
            raise broken_off_by


class TestAFile:
    def test_the_file_appears_at_the_end_of_the_block(self, tmp_path: Path) -> None:
        path = tmp_path / "a.vcd"
        path.write_bytes(b"old")
        with whole_file(path) as file:
            file.write(b"new")
            file.flush()
            assert path.read_bytes() == b"old"
            (part,) = tmp_path.glob("a.vcd.*.part")
            assert part.read_bytes() == b"new"
        assert path.read_bytes() == b"new"
        assert os.listdir(tmp_path) == ["a.vcd"]

    @pytest.mark.parametrize("error", [ValueError(), KeyboardInterrupt()])
    @pytest.mark.parametrize("old", [None, b"old"])
    def test_an_exception_keeps_the_older_file(self, error: BaseException, old: bytes | None, tmp_path: Path) -> None:
        path = tmp_path / "a.vcd"
        if old is not None:
            path.write_bytes(old)
        with pytest.raises(type(error)):
            write(path, broken_off_by=error)
        assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == ({"a.vcd": old} if old else {})

    @pytest.mark.parametrize("leads_to", ["a.vcd", "missing/a.vcd", "."])
    def test_nothing_is_written_through_a_link(self, leads_to: str, tmp_path: Path) -> None:
        (tmp_path / "there").mkdir()
        path = tmp_path / "there" / "a.vcd"
        path.write_bytes(b"somebody's")
        link = tmp_path / "link"
        link.symlink_to(tmp_path / "there" / leads_to)
        for writing in (write, lambda where: append(where, b"new"), growing_file):
            with refusing(OSError) as caught:
                writing(link)
            assert caught.value.filename == str(link)
        assert path.read_bytes() == b"somebody's"
        assert link.is_symlink()
        assert sorted(os.listdir(tmp_path)) == ["link", "there"]
        assert os.listdir(path.parent) == ["a.vcd"]

    def test_a_part_that_somebody_has_laid_is_left_alone(self, tmp_path: Path) -> None:
        """Nor can its name be foreseen."""
        there = tmp_path / "there"
        (tmp_path / "a.vcd.part").symlink_to(there)
        names = set()
        for _ in range(3):
            with whole_file(tmp_path / "a.vcd") as file:
                file.write(b"new")
                (part,) = set(os.listdir(tmp_path)) - {"a.vcd", "a.vcd.part"}
                names.add(part)
        assert len(names) == 3
        assert not there.exists()

    def test_a_name_may_be_as_long_as_the_system_takes(self, tmp_path: Path) -> None:
        write(tmp_path / f"{'a' * 251}.vcd")
        assert [len(name) for name in os.listdir(tmp_path)] == [255]

    def test_a_new_file_has_the_usual_rights(self, tmp_path: Path) -> None:
        write(tmp_path / "a.vcd")
        (tmp_path / "b").touch()
        assert (tmp_path / "a.vcd").stat().st_mode == (tmp_path / "b").stat().st_mode

    @pytest.mark.parametrize(("where", "error"), [("missing/a.vcd", FileNotFoundError), ("", IsADirectoryError)])
    def test_an_error_names_the_path_as_given(self, where: str, error: type[OSError], tmp_path: Path) -> None:
        with pytest.raises(error) as caught:
            write(tmp_path / where)
        assert caught.value.filename == str(tmp_path / where)


class TestWhatIsNoFile:
    def test_a_pipe_is_written_to(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        try:
            write(pipe)
            assert os.read(reader, 100) == b"new"
        finally:
            os.close(reader)
        assert pipe.is_fifo()

    def test_a_pipe_that_nothing_reads_is_not_waited_for(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        with refusing(OSError):
            write(pipe)

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
    def test_a_full_device_is_not_removed(self) -> None:
        with refusing(OSError):
            write(Path("/dev/full"))
        assert Path("/dev/full").is_char_device()

    def test_a_link_of_the_system_is_followed(self) -> None:
        """/dev/stdout leads to a pipe or a file of this process."""
        read, written = os.pipe()
        try:
            write(Path(f"/dev/fd/{written}"))
            assert os.read(read, 100) == b"new"
        finally:
            os.close(read)
            os.close(written)


class HeldError(PermissionError):
    """What Windows raises for a name that another program has open; elsewhere an error has no `winerror`."""

    winerror = 32


class TestAFileThatAnotherProgramHasOpen:
    """On Windows such a file cannot be replaced until the other program closes it."""

    @pytest.fixture
    def slept_s(self, monkeypatch: pytest.MonkeyPatch) -> list[float]:
        slept: list[float] = []
        monkeypatch.setattr("steptwin.host.common.whole_file.time.sleep", slept.append)
        return slept

    def refuse(self, monkeypatch: pytest.MonkeyPatch, times: int, error: OSError) -> None:
        replace, left = Path.replace, [times]

        def held(part: Path, path: Path) -> Path:
            left[0] -= 1
            if left[0] >= 0:
                raise error
            return replace(part, path)

        monkeypatch.setattr(Path, "replace", held)

    def test_is_waited_for(self, monkeypatch: pytest.MonkeyPatch, slept_s: list[float], tmp_path: Path) -> None:
        self.refuse(monkeypatch, 3, HeldError(13, "Access is denied"))
        write(tmp_path / "report.json")
        assert (tmp_path / "report.json").read_bytes() == b"new"
        assert sum(slept_s) == pytest.approx(0.3)

    def test_is_named_after_two_seconds(
        self, monkeypatch: pytest.MonkeyPatch, slept_s: list[float], tmp_path: Path
    ) -> None:
        (tmp_path / "report.json").write_bytes(b"old")
        self.refuse(monkeypatch, 1000, HeldError(13, "Access is denied"))
        with refusing(PermissionError):
            write(tmp_path / "report.json")
        assert sum(slept_s) == pytest.approx(2.0, abs=0.11)
        assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]

    def test_a_folder_without_permission_is_not_waited_for(
        self, monkeypatch: pytest.MonkeyPatch, slept_s: list[float], tmp_path: Path
    ) -> None:
        self.refuse(monkeypatch, 1000, PermissionError(13, "Permission denied"))
        with refusing(PermissionError):
            write(tmp_path / "report.json")
        assert slept_s == []
