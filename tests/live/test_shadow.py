"""`steptwin shadow` beside a served board: it joins by the boot-up, and names a restart that nobody asked for."""

import json
import subprocess
import sys
import threading
import time
from queue import Queue

import can

from steptwin import ServedBoard, WatchdogReset, load_robot

WAIT_S = 120.0
"""For what a process does on a busy computer."""


def test_it_names_what_the_board_does_of_its_own() -> None:
    with ServedBoard(load_robot("teaching-scara"), port=0) as served:
        words = ["shadow", "teaching-scara", "--connect", f"127.0.0.1:{served.port}", "--json", "--until-difference"]
        command = [sys.executable, "-m", "steptwin", *words]
        with (
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process,
            can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=served.port) as bus,
        ):
            assert process.stdout
            lines: Queue[str] = Queue()

            def read() -> None:
                for line in process.stdout or ():
                    lines.put(line)

            threading.Thread(target=read, daemon=True).start()
            until_s = time.monotonic() + WAIT_S
            while lines.empty() and time.monotonic() < until_s:
                # The shadow may have to start yet: a reset that it has not heard does not matter.
                bus.send(can.Message(arbitration_id=0x000, data=[0x81, 0], is_extended_id=False))
                time.sleep(1.0)
                served.operate(WatchdogReset())
                time.sleep(1.0)
            first = json.loads(lines.get(timeout=WAIT_S))
            assert (first["kind"], first["axis"], first["twin"]) == ("boot-up", "th1", "nothing")
            assert process.wait(WAIT_S) == 1
