"""What `steptwin serve` refuses before it serves."""

import socket

import pytest

from steptwin.host.cli.app import run

ROBOT = "warehouse-scara"


def test_a_port_that_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert run(["serve", ROBOT, "--port", str(port)]) == 4
        told = f"steptwin: 127.0.0.1:{port} is in use; --port 0 takes a free one\n"
        assert capsys.readouterr() == ("", told)
        assert run(["serve", ROBOT, "--port", str(port), "--machine", "driver-profile=4a"]) == 2
        assert "4a" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (
            ["--host", "0.0.0.0"],
            "--host 0.0.0.0: other machines could drive this board; --allow-remote permits it\n",
        ),
        (["--host", "::"], "--host ::: other machines could drive this board"),
        (["--host", "no.such.host.invalid"], "--host no.such.host.invalid: is not an address"),
        (["--port", "80"], "--port 80: is neither 0 nor from 1024 to 65535"),
        (["--port", "65536"], "--port 65536: is neither 0 nor from 1024 to 65535"),
        (["--port", "-1"], "--port -1: is neither 0 nor from 1024 to 65535"),
        (["--machine", "boards=4,3"], "--machine boards=4,3: 7 axes in all, but the robot has 6; try 4,2"),
        (["--speed", "0"], "--speed 0: is not from 0.001 to 1000"),
        (["--speed", "nan"], "--speed nan: is not from 0.001 to 1000"),
        (["-m", "bitrate=100000"], "--machine bitrate=100000: is not one of 125000, 250000, 500000, 1000000"),
        (["--channel", "vcan0"], "--channel vcan0: needs --interface NAME"),
        (["--interface", "virtuel"], "interface 'virtuel' is unknown: did you mean virtual?"),
        (["-i", "virtual", "--port", "5000"], "--port 5000: is for a socketcand server, not for --interface virtual"),
        (["-i", "virtual", "--host", "::1"], "--host ::1: is for a socketcand server, not for --interface virtual"),
        (["-i", "virtual", "--allow-remote"], "--allow-remote: is for listening, not for --interface virtual"),
        (["--machine", "stand-at=0 0"], "--machine stand-at: 2 values for the 6 joints"),
        (["--out", ""], "--out '': the name of the folder is empty"),
        (["--port", "0", "--log", "/no/such/folder/run.log"], "/no/such/folder/run.log: No such file or directory"),
    ],
)
def test_what_is_refused(options: list[str], complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", ROBOT, *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"steptwin: {complaint}")
    assert len(captured.err.splitlines()) == 1


def test_standing_outside_the_limits_is_warned_of(capsys: pytest.CaptureFixture[str]) -> None:
    """A machine may be pushed there by hand. The warning comes before the wrong port is refused."""
    assert run(["serve", ROBOT, "--machine", "stand-at=0 0 100 0 155.5 30", "--port", "80"]) == 2
    warning, refusal = capsys.readouterr().err.splitlines()
    assert warning.startswith("steptwin: warning: --machine stand-at: th2: 155.5 deg is outside -150..150 deg")
    assert refusal.startswith("steptwin: --port 80")


def test_an_interface_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", ROBOT, "-i", "socketcan", "-c", "no_such_can"]) == 4
    captured = capsys.readouterr()
    assert captured.err.startswith("steptwin: socketcan no_such_can: ")
    assert len(captured.err.splitlines()) == 1
