"""Files appear whole or not at all; pipes and devices are written to directly."""

import os
from pathlib import Path

import pytest

from steptwin.host.common.whole_file import whole_file


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
            assert (tmp_path / "a.vcd.part").read_bytes() == b"new"
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

    def test_a_link_is_followed(self, tmp_path: Path) -> None:
        (tmp_path / "there").mkdir()
        link, path = tmp_path / "link", tmp_path / "there" / "a.vcd"
        link.symlink_to(path)
        for data in (b"first", b"second"):
            write(link, data)
            assert path.read_bytes() == data
        assert link.is_symlink()
        assert os.listdir(path.parent) == ["a.vcd"]

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

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
    def test_a_full_device_is_not_removed(self, tmp_path: Path) -> None:
        device = tmp_path / "device"
        device.symlink_to("/dev/full")
        with pytest.raises(OSError, match=r"No space left on device: '.*/device'"):
            write(device)
        assert os.listdir(tmp_path) == ["device"]
        assert device.is_char_device()
