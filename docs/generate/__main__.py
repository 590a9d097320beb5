"""Write the generated pages of docs/ again: `python -m docs.generate`."""

from docs.generate.calibration_picture import write_calibration_picture
from docs.generate.control_port import CONTROL_PORT_PAGE, render_control_port
from docs.generate.driver import DRIVER_PAGE, render_driver
from docs.generate.driver_pictures import write_driver_pictures
from docs.generate.faults import FAULTS_PAGE, render_faults
from docs.generate.page import PAGE, render_page
from docs.generate.papers import write_papers
from docs.generate.pictures import write_pictures
from docs.generate.protocol import PROTOCOL_PAGE, render_protocol
from docs.generate.robot_drawings import write_robot_drawings
from docs.generate.robot_files import ROBOT_FILES_PAGE, render_robot_files
from docs.generate.warehouse_picture import write_warehouse_picture
from docs.generate.waveform_pictures import write_waveform_pictures
from steptwin.controller.backend import fastest_kernel
from steptwin.host.papers.runs import Runs


def main() -> None:
    """Write each page before its pictures: rendering docs/robots.md makes the runs that they show."""
    CONTROL_PORT_PAGE.write_text(render_control_port(), encoding="utf-8")
    DRIVER_PAGE.write_text(render_driver(), encoding="utf-8")
    write_driver_pictures()
    FAULTS_PAGE.write_text(render_faults(), encoding="utf-8")
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
