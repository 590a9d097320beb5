"""Options that choose no board, or contradict each other."""

import pytest

from steptwin.host.cli.app import run
from steptwin.host.cli.live.connection import BoardAddress


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("", "which board? --connect HOST:PORT, or -i INTERFACE -c CHANNEL"),
        ("--connect 1.2.3.4:", "--connect 1.2.3.4:: is not of the form HOST:PORT, such as 127.0.0.1:29536"),
        ("--connect 1.2.3.4:65536", "--connect 1.2.3.4:65536: is not of the form HOST:PORT, such as 127.0.0.1:29536"),
        ("--connect ::1:29536", "--connect ::1:29536: put an IPv6 address in brackets, such as [::1]:29536"),
        ("--connect [::1]:0", "--connect [::1]:0: is not of the form HOST:PORT, such as 127.0.0.1:29536"),
        ("--connect a:1 -i virtual", "--connect a:1 and --interface virtual: give only one of them"),
        ("-i socketcam", "--interface 'socketcam' is unknown: did you mean socketcan or socketcand?"),
        ("-c can0", "--channel can0: is for a live board: --connect HOST:PORT or --interface NAME"),
        ("-b 500000", "--bitrate 500000: is for a live board: --connect HOST:PORT or --interface NAME"),
        (
            "--connect 127.0.0.1:29536 -b 500000",
            "--bitrate 500000: is for --interface; the server of --connect has its own",
        ),
        ("-i virtual -b 0", "--bitrate 0: is not above 0 bit/s"),
    ],
)
def test_invalid_connections(capsys: pytest.CaptureFixture[str], options: str, message: str) -> None:
    assert run(["status", "warehouse-scara", *options.split()]) == 2
    assert capsys.readouterr() == ("", f"steptwin: {message}\n")


@pytest.mark.parametrize("text", ["[::1]:4711", "[::1]"])
def test_an_ipv6_address_in_brackets(text: str) -> None:
    found = BoardAddress(connect=text).connection(None)
    assert found
    assert (found.host, found.title) == ("::1", "[::1]:4711" if text.endswith("4711") else "[::1]:29536")
