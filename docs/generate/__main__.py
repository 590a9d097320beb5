"""Write the generated pages of docs/ again: `python -m docs.generate`."""

from docs.generate.api_page import API_PAGE
from docs.generate.command_line import COMMAND_LINE_PAGE, render_command_line
from docs.generate.drawer_pull_film import write_drawer_pull_film
from docs.generate.driver_page import DRIVER_PAGE, write_driver_pictures
from docs.generate.machine_pages import FAULTS_PAGE, RUN_FOLDER_PAGE
from docs.generate.machine_row import write_machines_row
from docs.generate.masters_page import MASTERS_PAGE
from docs.generate.motion_pictures import write_motion_pictures
from docs.generate.paper_pages import write_papers
from docs.generate.personalities_page import PERSONALITIES_PAGE
from docs.generate.pictures import (
    write_calibration_picture,
    write_machine_pictures,
    write_pictures,
    write_warehouse_picture,
    write_waveform_pictures,
)
from docs.generate.programs_page import PROGRAMS_PAGE
from docs.generate.protocol import PROTOCOL_PAGE
from docs.generate.robot_drawings import ROBOT_FILES_PAGE, write_robot_drawings
from docs.generate.runs import Runs


def main() -> None:
    """Write the pages and their pictures; each run is made once."""
    API_PAGE.write()
    COMMAND_LINE_PAGE.write_text(render_command_line(), encoding="utf-8")
    DRIVER_PAGE.write()
    write_driver_pictures()
    FAULTS_PAGE.write()
    MASTERS_PAGE.write()
    PROGRAMS_PAGE.write()
    PERSONALITIES_PAGE.write()
    PROTOCOL_PAGE.write()
    ROBOT_FILES_PAGE.write()
    RUN_FOLDER_PAGE.write()
    write_robot_drawings()
    runs = Runs()
    write_papers(runs)
    write_pictures(runs)
    write_waveform_pictures(runs)
    write_calibration_picture()
    write_machine_pictures()
    write_machines_row()
    write_motion_pictures()
    write_warehouse_picture()
    write_drawer_pull_film(runs)


if __name__ == "__main__":
    main()
