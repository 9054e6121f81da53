"""The command line: one file per verb; this one joins them and turns errors into exit codes.

Exit codes: 0 done, 2 the input was wrong (one line on stderr says what), 1 our fault,
130 stopped by Ctrl-C.
"""

import logging
import sys
import warnings

import typer

from retraverse._version import __version__
from retraverse.cli import (
    compare,
    datasets,
    demo,
    doctor,
    evaluate,
    listing,
    localize,
    maps,
    reproduce,
    study,
    train,
    view,
    weights,
)
from retraverse.errors import RetraverseError

__all__ = ["VERBS", "app", "run"]

VERBS = (
    "demo",
    "compare",
    "map build",
    "map info",
    "map extend",
    "localize",
    "evaluate",
    "techniques",
    "matchers",
    "datasets simulate",
    "weights list",
    "weights get",
    "weights import",
    "weights verify",
    "train jpeg-distil",
    "train jpeg-labels",
    "train calc",
    "train deepseqslam",
    "train netvlad",
    "train regionvlad",
    "train jpeg-tables",
    "study check",
    "study run",
    "study show",
    "study report",
    "reproduce",
    "view",
    "doctor",
)
"""Every verb, in the order a newcomer meets them."""

app = typer.Typer(
    name="retraverse",
    help="Where on a known route a camera is now, although season, light and weather changed.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("demo")(demo.demo)
app.command("compare")(compare.compare)
app.add_typer(maps.app, name="map")
app.command("localize")(localize.localize)
app.command("evaluate")(evaluate.evaluate)
app.command("techniques")(listing.techniques)
app.command("matchers")(listing.matchers)
app.add_typer(datasets.app, name="datasets")
app.add_typer(weights.app, name="weights")
app.add_typer(train.app, name="train")
app.add_typer(study.app, name="study")
app.command("reproduce")(reproduce.reproduce)
app.command("view")(view.view)
app.command("doctor")(doctor.doctor)


@app.callback(invoke_without_command=True)
def _version(
    version: bool = typer.Option(False, "--version", help="Print the version and stop."),
) -> None:
    if version:
        print(f"retraverse {__version__}")
        raise typer.Exit


def run() -> None:
    """Run the command line and exit the process with the code that says how it went."""
    logging.addLevelName(logging.WARNING, "warning")
    logging.addLevelName(logging.ERROR, "error")
    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING)
    warnings.showwarning = _show_warning
    try:
        code = app(standalone_mode=False)
    except typer.Abort:
        code = _complain("stopped", 130)
    except KeyboardInterrupt:
        code = _complain("stopped", 130)
    except BrokenPipeError:
        # The reader of our output went away (`| head`): nothing more to say to it.
        sys.stderr.close()
        code = 0
    except RetraverseError as error:
        code = _complain(f"retraverse: {error}", 2)
    except Exception as error:
        code = _handle_other(error)
    sys.exit(code or 0)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Say a warning in one line, without the place in our code it comes from."""
    print(f"warning: {message}", file=sys.stderr)


def _handle_other(error: Exception) -> int:
    """Return the exit code of a wrong option, a file that cannot be used, or a bug of ours."""
    show, exit_code = getattr(error, "show", None), getattr(error, "exit_code", None)
    if show is not None and isinstance(exit_code, int):
        show()
        return exit_code
    if isinstance(error, OSError):
        return _complain(f"retraverse: {error.strerror or error}: {error.filename or ''}", 2)
    logging.getLogger("retraverse").exception("this is our fault, please report it")
    return 1


def _complain(message: str, code: int) -> int:
    print(message, file=sys.stderr)
    return code
