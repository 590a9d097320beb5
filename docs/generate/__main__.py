"""Write the generated pages of docs/ again: `python -m docs.generate`."""

from docs.generate.control_port import CONTROL_PORT_PAGE, render_control_port
from docs.generate.driver_page import DRIVER_PAGE, render_driver, write_driver_pictures
from docs.generate.faults import FAULTS_PAGE, render_faults
from docs.generate.machine_page import MACHINE_PAGE, render_machine_options
from docs.generate.papers import write_papers
from docs.generate.pictures import (
    write_calibration_picture,
    write_pictures,
    write_warehouse_picture,
    write_waveform_pictures,
)
from docs.generate.protocol import PROTOCOL_PAGE, render_protocol
from docs.generate.robot_drawings import ROBOT_FILES_PAGE, render_robot_files, write_robot_drawings
from docs.generate.robots_page import PAGE, render_page
from steptwin.controller.motion.backend import fastest_kernel
from steptwin.host.studies.papers.runs import Runs


def main() -> None:
    """Write each page before its pictures: rendering docs/robots.md makes the runs that they show."""
    CONTROL_PORT_PAGE.write_text(render_control_port(), encoding="utf-8")
    DRIVER_PAGE.write_text(render_driver(), encoding="utf-8")
    write_driver_pictures()
    FAULTS_PAGE.write_text(render_faults(), encoding="utf-8")
    MACHINE_PAGE.write_text(render_machine_options(), encoding="utf-8")
    PROTOCOL_PAGE.write_text(render_protocol(), encoding="utf-8")
    ROBOT_FILES_PAGE.write_text(render_robot_files(), encoding="utf-8")
    write_robot_drawings()
    runs = Runs(fastest_kernel())
    PAGE.write_text(render_page(runs), encoding="utf-8")
    write_pictures(runs)
    write_waveform_pictures(runs)
    write_calibration_picture()
    write_warehouse_picture()
    write_papers(runs)


if __name__ == "__main__":
    main()
