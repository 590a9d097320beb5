"""`steptwin run-image`: the examples pass, their faulty forms fail for their fault, and bad input is refused."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import python_kernel
from steptwin.features.firmware.options import FirmwareOptions
from steptwin.features.stm32.image import read_image
from steptwin.features.stm32.options import Stm32Options
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts
from steptwin.host.twin.machine.evidence import axes_evidence
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.features.stm32.examples import EXAMPLES, ROBOT


def _run(capsys: pytest.CaptureFixture[str], *words: str, kernel: str = "python") -> tuple[int, str, str]:
    code = run(["run-image", *words, "--kernel", kernel])
    told = capsys.readouterr()
    return code, told.out, told.err


@pytest.mark.slow  # half a second at 72 MHz in plain Python
@pytest.mark.parametrize(
    ("name", "code", "steps", "reason"),
    [
        ("compare_stepper", 0, [0, 500], ""),
        ("compare_stepper_fault", 1, [0, 498], "DIR changed too late before CLK: step the wrong way"),
        ("systick_stepper", 0, [0, 0], ""),
        ("systick_stepper_fault", 1, [0, 0], "CLK high too short: step missed: 2000 times"),
        ("dma_stepper", 0, [0, 0], ""),
        ("dma_stepper_fault", 1, [0, 0], "CLK high too short: step missed"),
    ],
)
def test_an_example_does_what_it_says(
    capsys: pytest.CaptureFixture[str], name: str, code: int, steps: list[int], reason: str
) -> None:
    file = str(EXAMPLES / f"{name}.elf")
    ended, out, err = _run(capsys, file, "--robot", str(ROBOT), "--until-text", "done", "--json")
    document = json.loads(out)
    assert (ended, document["passed"], [axis["steps"] for axis in document["axes"]]) == (code, not code, steps)
    assert document["sent"]["USART1"].startswith("ready\ndone")
    assert document["not_modelled"] == []
    assert all(reason in each for each in document["reasons"])
    assert bool(document["reasons"]) == bool(reason)
    assert err == ""


@pytest.mark.slow  # a fifth of a second at 72 MHz in plain Python
def test_a_switch_of_the_machine_is_read_by_its_pin(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    robot = tmp_path / "arm.toml"
    switch = '[joints.left.switches]\npositive_limit = 10.0\n\n[joints.left.pins]\npositive_limit = "!PA5"'
    robot.write_text(ROBOT.read_text().replace("[joints.left.pins]", switch).replace("upper = 100.0", "upper = 9.0", 1))
    file = str(EXAMPLES / "systick_stepper.elf")
    code, out, _ = _run(capsys, file, "--robot", str(robot), "--until-text", "limit", "--json")
    document = json.loads(out)
    assert code == 0
    # the switch is at step 400; the firmware reads it with the next tick of 20 kHz
    assert document["axes"][0]["steps"] in (400, 401)


def test_a_fault_is_told_with_its_place_and_registers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    content = bytearray((EXAMPLES / "compare_stepper.elf").read_bytes())
    image = read_image(EXAMPLES / "compare_stepper.elf")
    offset = content.index(image.segments[0][1]) + image.address_of("main") - 0x08000000
    content[offset : offset + 6] = bytes.fromhex("4ff0c0400168")  # mov.w r0, #0x60000000; ldr r1, [r0]
    (path := tmp_path / "fw.elf").write_bytes(content)
    code, out, _ = _run(capsys, str(path), "--robot", str(ROBOT), "--for", "1ms")
    told = next(line for line in out.splitlines() if line.startswith("reason: HardFault"))
    assert code == 1
    assert told.startswith(f"reason: HardFault at 0x{image.address_of('main') + 4:08X} in main+4 (compare_stepper.c:")
    assert "): there is nothing at 0x60000000, or it cannot be written; r0=0x60000000 r1=" in told


def test_the_beginning_of_an_example_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = _run(capsys, str(EXAMPLES / "compare_stepper.elf"), "--robot", str(ROBOT), "--for", "1ms")
    assert code == 0
    assert "USART1: ready" in out
    assert out.splitlines()[-1].endswith("PASSED")


def _refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    code, out, err = _run(capsys, *words)
    assert (code, out) == (2, "")
    return err.removeprefix("steptwin: ").strip()


def test_a_run_needs_a_robot_with_a_chip(capsys: pytest.CaptureFixture[str]) -> None:
    file = str(EXAMPLES / "compare_stepper.elf")
    assert _refused(capsys, file).startswith("--robot is missing")
    assert "turntable does not say what hangs at which pin: it has no [joints.NAME.pins]" in _refused(
        capsys, file, "--robot", "turntable"
    )
    assert _refused(capsys, file, "--robot", str(ROBOT), "--for", "2") == (
        "--for 2: is no time with a unit, such as 2s, 50ms or 100us"
    )


def test_a_file_that_is_no_image_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    refused = _refused(capsys, str(ROBOT), "--robot", str(ROBOT))
    assert refused == f"{ROBOT}: is no ELF, and its name does not end in .bin: give the file that is flashed"


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        ('step = "PA2"', 'step = "PA0"', "right's step: PA0 is that of left's step already"),
        ('step = "PA2"', 'step = "PF2"', "'PF2': is no pin from PA0 to PE15, such as PA0, or !PA0"),
        ("[joints.right.pins]", "[joints.left.second_pins]", "joints.left.second_pins: the joint has no second motor"),
    ],
)
def test_a_wrong_wire_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, before: str, after: str, sentence: str
) -> None:
    robot = tmp_path / "arm.toml"
    robot.write_text(ROBOT.read_text().replace(before, after))
    assert sentence in _refused(capsys, str(EXAMPLES / "compare_stepper.elf"), "--robot", str(robot))


def test_a_pin_that_is_never_an_output_fails_the_run(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    robot = tmp_path / "arm.toml"
    robot.write_text(ROBOT.read_text().replace('step = "PA2"', 'step = "PB2"'))
    file = str(EXAMPLES / "compare_stepper.elf")
    code, out, _ = _run(capsys, file, "--robot", str(robot), "--for", "1ms")
    assert code == 1
    assert "reason: right: PB2, its STEP, was never an output" in out


def test_a_loop_before_main_is_named_with_its_place(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    content = bytearray((EXAMPLES / "compare_stepper.elf").read_bytes())

    image = read_image(EXAMPLES / "compare_stepper.elf")
    offset = content.index(image.segments[0][1]) + image.address_of("reset") - 0x08000000
    content[offset : offset + 2] = b"\xfe\xe7"  # b .
    (path := tmp_path / "fw.elf").write_bytes(content)
    refused = _refused(capsys, str(path), "--robot", str(ROBOT), "--for", "0.1ms")
    assert refused.startswith(f"{path}: has not reached main after 0.0001 s: the processor is at 0x0800")
    assert " in reset (start.c:" in refused


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="needs arm-none-eabi-gcc")
@pytest.mark.slow  # a compiler
def test_the_images_are_those_of_their_sources(tmp_path: Path) -> None:
    built = tmp_path / "built"
    shutil.copytree(EXAMPLES, built, ignore=shutil.ignore_patterns("*.elf"))
    own = Path(__file__).parent
    shutil.copy(own / "wiring.c", built)
    subprocess.run(["make", "-s", "-C", str(built), "all", "wiring.elf"], check=True, timeout=120, capture_output=True)

    for path in sorted(built.glob("*.elf")):
        folder = own if path.stem == "wiring" else EXAMPLES
        assert path.stat().st_size < 20_000
        assert read_image(path).functions == read_image(folder / path.name).functions, path.name


def test_a_board_runs_one_program_and_one_chip_drives_all_axes() -> None:
    robot = load_robot(str(ROBOT))
    image = Stm32Options(image=EXAMPLES / "compare_stepper.elf").fitted(robot, Path())
    own = FirmwareOptions(firmware=ROBOT)
    with pytest.raises(
        InputError, match=r"^firmware and stm32: each gives the board's program: leave one of them out$"
    ):
        MachineOptions(extras=(image, own)).program()
    with pytest.raises(InputError, match=r"^boards: one STM32F103 drives all axes: leave boards out, or image$"):
        MachineOptions(extras=(image,), axes_per_board=(1, 1)).check_features()


def test_an_image_needs_a_robot_read_with_it() -> None:
    with pytest.raises(InputError, match="needs the robot's file"):
        MachineOptions(extras=(Stm32Options(image="fw.elf"),)).program()


def test_an_image_begins_again_after_a_power_cycle() -> None:
    robot = load_robot(str(ROBOT))
    options = Stm32Options(image=EXAMPLES / "compare_stepper.elf").fitted(robot, Path(), compiled=False)
    machine = EmulatedMachine(MachineParts.of(robot, python_kernel(), MachineOptions(extras=(options,))))
    simulation = machine.simulation
    simulation.run_until(2 * COUNTS_PER_MS)
    simulation.power_cycle()
    simulation.run_until(4 * COUNTS_PER_MS)
    rises_ms = [evidence.clk_rise_counts / COUNTS_PER_MS for evidence in axes_evidence(machine)]
    began_ms = rises_ms[0][0]
    assert 0.7 < began_ms < 0.8  # after "ready" at 115 200 baud
    assert rises_ms[0][rises_ms[0] > 2.0][0] == pytest.approx(2.0 + began_ms, abs=1e-4)
