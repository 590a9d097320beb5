"""Only files are read, only what is no link is written; the system's own pipes and links in /dev are taken."""

import os
from pathlib import Path

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import made_folder, read_text
from tests.messages import refusing

NO_FILE = "is no file but a pipe or a device, which is not read"


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "robot.toml")
    with refusing(InputError):
        read_text(str(tmp_path / "robot.toml"), 100)


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_not_read(device: str, tmp_path: Path) -> None:
    """By its own name or through a link that somebody has laid."""
    (tmp_path / "robot.toml").symlink_to(device)
    for name in (device, str(tmp_path / "robot.toml")):
        with refusing(InputError):
            read_text(name, 100)


def test_a_pipe_of_the_shell_is_read_to_its_end(tmp_path: Path) -> None:
    """As of `run ROBOT <(program)`; but not through a link in a folder."""
    read, written = os.pipe()
    (tmp_path / "robot.toml").symlink_to(f"/dev/fd/{read}")
    try:
        os.write(written, b"t,th1")
        os.close(written)
        with refusing(InputError):
            read_text(str(tmp_path / "robot.toml"), 100)
        assert read_text(f"/dev/fd/{read}", 100) == "t,th1"
    finally:
        os.close(read)


def test_an_inner_folder_is_made_but_is_no_link(tmp_path: Path) -> None:
    for _ in range(2):
        assert made_folder(tmp_path / "rows") == tmp_path / "rows"
    (tmp_path / "link").symlink_to(tmp_path / "rows")
    with refusing(OSError):
        made_folder(tmp_path / "link")
