"""`python -m docs.generate`: write docs/protocol.md, docs/robots.md and its pictures anew."""

from controller.backend import fastest_kernel
from docs.generate.page import PAGE, render_page
from docs.generate.pictures import write_pictures
from docs.generate.protocol import PROTOCOL_PAGE, render_protocol
from docs.generate.runs import Runs


def main() -> None:
    """Texts first: it makes the runs that the pictures show."""
    PROTOCOL_PAGE.write_text(render_protocol(), encoding="utf-8")
    runs = Runs(fastest_kernel())
    PAGE.write_text(render_page(runs), encoding="utf-8")
    write_pictures(runs)


if __name__ == "__main__":
    main()
